"""The kinds of disturbances; a module each. Plug-ins may bring further ones."""
