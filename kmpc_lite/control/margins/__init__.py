"""Margins: how far plans and commands stay away from obstacles for what the model does not know."""
