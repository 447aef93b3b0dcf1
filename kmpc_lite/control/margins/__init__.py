"""Margins: how far plans and commands stay away from obstacles for what the model does not know.

`obstacle_margins` computes the margin of each obstacle in a plan, `stop_margins` those of motions
that are about to be driven; `model_margins` builds them for one model.
"""
