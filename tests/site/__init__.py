"""The documentation site: pages that the code writes, pictures of the effects, a link checker."""
