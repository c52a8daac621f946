"""Refuse keywords and values of an earlier version with an error that gives the new word."""

from dataclasses import dataclass, field

from pyomo_fesd.core.errors import FesdError


@dataclass(frozen=True)
class Renamed:
    """The renamed words of one caller.

    Attributes
    ----------
    caller : str
    keywords : dict old -> new
    values : dict keyword -> {old: new}
    """

    caller: str
    keywords: dict = field(default_factory=dict)
    values: dict = field(default_factory=dict)

    def refuse(self, given: dict) -> None:
        """Raise a ``FesdError`` for a keyword, or a value of a keyword, that has another name now."""
        for old, new in self.keywords.items():
            if old in given:
                raise FesdError(self.caller, f"the keyword '{old}' has another name since version 0.2", f"write {new}=")
        for keyword, words in self.values.items():
            old = given.get(keyword)
            if isinstance(old, str) and old in words:
                raise FesdError(
                    self.caller, f"{keyword}='{old}' has another name since version 0.2", f"write {keyword}='{words[old]}'"
                )
