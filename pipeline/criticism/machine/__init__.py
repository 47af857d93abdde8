"""The motor as equations: constants, hooks for effects, a shaft of one or two masses."""
