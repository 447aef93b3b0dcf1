"""Dictionaries: how a pose is lifted, and which commands enter the bilinear model; one a file."""

from kmpc_lite.model.dictionary.base import MAX_LAG, MAX_SIZE, Dictionary, dictionary_to_config
from kmpc_lite.model.dictionary.config import dictionary_from_config
from kmpc_lite.model.dictionary.hermite import HermiteTrigDictionary, UnicycleDictionary
from kmpc_lite.model.dictionary.input_history import InputHistoryDictionary
from kmpc_lite.model.dictionary.response import ResponseDictionary

__all__ = [
    "MAX_LAG",
    "MAX_SIZE",
    "Dictionary",
    "HermiteTrigDictionary",
    "InputHistoryDictionary",
    "ResponseDictionary",
    "UnicycleDictionary",
    "dictionary_from_config",
    "dictionary_to_config",
]
