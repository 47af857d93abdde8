"""MCAP in: a strict front-to-back reader that decodes whole batches with numpy.

`container.scan` proves the file's structure and checksums, `messages.batches` hands out the
messages, `tables.read_tables` decodes them. Whatever the bytes are, only `CaptureError` comes out.

Reference: MCAP format specification, https://mcap.dev/spec.
"""
