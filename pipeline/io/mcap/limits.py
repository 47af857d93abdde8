"""How much a file may claim before it is believed; checked before anything is allocated."""

from __future__ import annotations

MAX_FILE_BYTES = 4 * 2**30
MAX_CHUNK_BYTES = 64 * 2**20
MAX_RATIO = 1000
"""Largest unpacked size over packed size of a chunk."""
MAX_RATIO_FLOOR_BYTES = 2**20
"""Chunks that unpack to less than this are harmless whatever their ratio."""
MAX_WHOLE_RATIO = 100
"""Largest unpacked size over size of a whole file; a log of a motor at rest comes near it."""
MAX_WHOLE_FLOOR_BYTES = 256 * 2**20
"""Files that unpack to less than this are harmless whatever their ratio."""
MAX_SCHEMA_BYTES = 2**20
MAX_FIELDS = 4096
MAX_DEPTH = 32
MAX_JSON_BYTES = 16 * 2**20
MAX_MAP_ENTRIES = 4096
