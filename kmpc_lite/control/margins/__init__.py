"""What the model does not know, as distances.

`margins` computes the margin of each obstacle in a plan, and those of motions that are about to be
driven, from the errors that a model expects of itself (`model_noise`).
"""
