"""Rasters read over a network: GDAL's settings for few requests, and servers' errors."""

from __future__ import annotations

import contextlib
import os
from typing import Any

import rasterio
from rasterio.env import getenv, hasenv

from ..raster_names import is_remote
from ..stac_items import SILENT_SECONDS

# https://gdal.org/en/stable/user/virtual_file_systems.html; the user's settings take precedence.
_SETTINGS = {
    # Sidecar files are not looked for, as each look-up is a request.
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
    # The directories of a Cloud Optimized GeoTIFF in one request.
    "GDAL_INGESTED_BYTES_AT_OPEN": "32768",
    "GDAL_HTTP_MERGE_CONSECUTIVE_RANGES": "YES",
    "GDAL_HTTP_MULTIPLEX": "YES",
    # Cache shared by the handles of all threads.
    "CPL_VSIL_CURL_CACHE_SIZE": "100000000",
    "GDAL_HTTP_MAX_RETRY": "3",
    "GDAL_HTTP_RETRY_DELAY": "1",
    "GDAL_HTTP_CONNECTTIMEOUT": str(SILENT_SECONDS),
    "GDAL_HTTP_LOW_SPEED_TIME": str(SILENT_SECONDS),
    "GDAL_HTTP_LOW_SPEED_LIMIT": "1",
}

# GDAL's words for a server's answers, and explanations for users.
_ANSWERS = {
    "404": "there is no such file on the server",
    "does not exist in the file system": "there is no such file on the server",
    "403": "the server does not allow it (HTTP 403); credentials are GDAL's, as AWS_ACCESS_KEY_ID",
    "401": "the server does not allow it (HTTP 401); credentials are GDAL's, as GDAL_HTTP_HEADERS",
    "IReadBlock failed": "the server sends its pixels no more, or they are damaged",
    "Range downloading not supported": "the server does not send parts of files; download it first",
}


def environment(name: str) -> Any:
    """Return the environment in which GDAL opens and reads a raster; the usual one for files."""
    if not is_remote(name):
        return contextlib.nullcontext()
    own = {*os.environ, *(getenv() if hasenv() else ())}
    return rasterio.Env(**{key: value for key, value in _SETTINGS.items() if key not in own})


def reason_of_server(reason: str, name: str) -> str:
    """Return GDAL's reason why a remote raster cannot be read, explained for users.

    Numbers in the raster's own name, such as a server's port, must not count as answers.
    """
    stated = reason.replace(name.removeprefix("/vsicurl/"), "")
    if reason.startswith("CURL error: "):
        return f"the server does not answer ({reason.removeprefix('CURL error: ')})"
    return next((words for text, words in _ANSWERS.items() if text in stated), reason)
