"""What is kept between runs, and the keys and versions that it is kept by."""
