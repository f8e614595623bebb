"""MuJoCo models as slave and world: any MJCF file with an arm takes the place of the simulated slave.

``load_robot("scene.xml", tip="gripper")`` is the arm of a scene; ``--set robot=scene.xml geometry=[tip=gripper]`` runs
a session with it. The arm's kinematics come from the model, its motion and all contacts from MuJoCo.
"""
