"""What must hold exactly: by multipliers, or where there are very many by large weights."""
