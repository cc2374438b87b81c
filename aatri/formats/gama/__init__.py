"""GNU Gama: networks of gama-local as XML (gkf)."""
