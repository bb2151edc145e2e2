"""Laws of the user: classes in files of their own, called beside or in place of the built-in ones."""
