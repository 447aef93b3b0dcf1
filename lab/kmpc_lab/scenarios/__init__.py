"""Scenario files of the digital twin."""
