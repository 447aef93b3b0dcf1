"""Margins: how far plans and commands stay away from obstacles for what the model does not know.

`obstacle_margins` computes the margin of each obstacle; `model_margins` builds it, the check of
single commands and the drift detector for one model.
"""
