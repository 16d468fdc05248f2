"""Licences by their SPDX identifiers, and what data hubs call them."""

from __future__ import annotations

import re
from typing import Final

from packaging.licenses import InvalidLicenseExpression, canonicalize_license_expression

from weaves.errors import BadInput, nearest

_OF_HUBS: Final = {
    **dict.fromkeys(("CC0-1.0", "CC-BY-4.0", "CC-BY-SA-4.0", "CC-BY-NC-4.0", "CC-BY-NC-SA-4.0", "MIT", "Apache-2.0")),
    "ODbL-1.0": "odbl",
    "ODC-By-1.0": "odc-by",
    "PDDL-1.0": "pddl",
}
"""Common licences of data, with the hubs' name if it is not the identifier in small letters."""


def licence_id(given: str | None) -> str:
    """Return an SPDX identifier as it is written.

    Raises
    ------
    BadInput
        If none is given, or there is no such licence.
    """
    if not given:
        allowed = "an SPDX identifier such as CC-BY-4.0 is needed: without a licence nobody may use the data"
        raise BadInput("publish", "--licence", given, allowed)
    try:
        if not re.fullmatch(r"[A-Za-z0-9.-]{1,60}", given) or given.lower().startswith("licenseref-"):
            raise InvalidLicenseExpression(given)
        return str(canonicalize_license_expression(given))
    except InvalidLicenseExpression as error:
        allowed = f"the SPDX identifier of one licence is needed; {nearest(given, _OF_HUBS)}"
        raise BadInput("publish", "--licence", given, allowed) from error


def licence_url(licence: str) -> str:
    """Return the address of a licence's text."""
    return f"https://spdx.org/licenses/{licence}.html"


def hub_licence(licence: str) -> dict[str, str]:
    """Return the keys of a data set card that state the licence."""
    if licence in _OF_HUBS:
        return {"license": _OF_HUBS[licence] or licence.lower()}
    return {"license": "other", "license_name": licence.lower(), "license_link": licence_url(licence)}
