def render_regression(found):
    return found.headline
