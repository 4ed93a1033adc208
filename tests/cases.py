"""How many cases are tried by the tests that find more the longer they look."""

CASES = 200  # `pytest --cases N`; conftest.py puts it here before tests are imported
