"""Running a plan: tasks, spawned workers, what a running stage may talk to."""
