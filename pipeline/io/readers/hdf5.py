"""HDF5: numeric vectors by their path, `group/name`; needs h5py (the extra `hdf5`)."""

from __future__ import annotations

from functools import partial

from pipeline.io.tables.foreign import Reader
from pipeline.io.tables.hdf5_tables import tables

READER = Reader("hdf5", partial(tables, form="hdf5"), suffixes=(".h5", ".hdf5"))
