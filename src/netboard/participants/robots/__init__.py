"""Robot partners: policies that are controllers of a robot, not models of a person. Pure.

Open `robot.py` first: what all robots share, their hand and their parameters. `sight` estimates ball and board from the
views, `steering` turns a wanted tilt into a movement of the hand, and each other file is one partner, an entry of
`netboard.participants.seat.partners.POLICIES`. A robot sees what the curtain lets its seat see, and feels its own hand.

All robots compute in coordinates of their own side: a ball towards their hand is positive, as is a tilt that raises
it. So a robot plays both sides, and its mirror image does the same to the bit.

Parameters
----------
c : record of STEERING
    Constants of a robot that leads or follows, with those of its hand and of the board.
hand, board : record of HAND, record of BOARD
    Constants of a robot's hand, and of the board as it knows it.
sight : record of SIGHT
    What a robot knows of ball and board.
observation : record of OBSERVATION
    What the robot observes now.
action : record of ACTION
    What its hand does until the next update.
"""
