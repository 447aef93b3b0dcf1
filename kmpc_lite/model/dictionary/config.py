"""Dictionaries from values that JSON can hold."""

from __future__ import annotations

from typing import Any

from kmpc_lite.errors import ModelError
from kmpc_lite.model.dictionary.base import Dictionary
from kmpc_lite.model.dictionary.hermite import HermiteTrigDictionary, UnicycleDictionary
from kmpc_lite.model.dictionary.input_history import InputHistoryDictionary
from kmpc_lite.model.dictionary.response import ResponseDictionary


def dictionary_from_config(config: dict[str, Any]) -> Dictionary:
    """Build the dictionary that `dictionary_to_config` described.

    Raises ModelError for a kind that this version does not know, or arguments that it does not
    take.
    """
    if not isinstance(config, dict):
        raise ModelError(f"dictionary: expected its kind and arguments, got {config!r}")
    arguments = {key: value for key, value in config.items() if key != "kind"}
    try:
        match config.get("kind"):
            case "unicycle":
                return UnicycleDictionary(**arguments)
            case "hermite_trig":
                return HermiteTrigDictionary(**arguments)
            case "input_history":
                base = dictionary_from_config(arguments["base"])
                return InputHistoryDictionary(base, tuple(arguments["lags"]), arguments["product"])
            case "response":
                return ResponseDictionary(
                    **{**arguments, "base": dictionary_from_config(arguments["base"])}
                )
    except (TypeError, KeyError, ValueError) as error:
        if isinstance(error, ModelError):
            raise
        raise ModelError(f"dictionary {config}: {error}") from error
    raise ModelError(
        f"unknown dictionary kind {config.get('kind')!r}; expected unicycle, "
        "hermite_trig, input_history or response"
    )
