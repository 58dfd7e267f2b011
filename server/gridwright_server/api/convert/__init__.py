"""Between messages and the server's own types; all validation of input happens here."""
