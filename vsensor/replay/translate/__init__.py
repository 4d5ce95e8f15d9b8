"""Translate: a log's lane frames decoded by one profile and sent as another's."""

from vsensor.replay.translate.stage import Translate, TranslateState, translated

__all__ = ["Translate", "TranslateState", "translated"]
