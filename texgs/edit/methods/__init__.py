"""Ways to give a scene a new look. Their modules define METHOD, one or several; see texgs/edit/method.py."""
