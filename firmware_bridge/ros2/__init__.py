"""A ROS 2 node without a ROS installation: topics of rmw_zenoh, read and written with zenoh.

`names` says what things are called on the wire, `message_types` what they consist of, `node` is the
session, `inputs` makes poses, obstacles and goals of messages, `driver` is what the safety gate
commands, `navigator` the controller, `outputs` and `telling` what others see.
"""
