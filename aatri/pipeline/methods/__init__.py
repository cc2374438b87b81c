"""The methods there are: found, read off, catalogued by the digest of their code."""
