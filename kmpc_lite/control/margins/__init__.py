"""Margins: what is kept from obstacles for what the model does not know."""
