"""Trials over scenarios, policies and engines."""
