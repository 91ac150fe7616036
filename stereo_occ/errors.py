"""The one exception type for a user's mistake."""


class UserError(Exception):
    """Something the user can put right: the message is one line with what, which value and what to do.

    Entry points print the message alone, without a traceback, and exit with code 2.
    """
