"""The references of any robot; a module each. Plug-ins bring further ones."""
