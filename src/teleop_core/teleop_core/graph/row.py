"""Row: fields of the records of stages' ports, of every topic of the built-in stages.

Written by docs/generate.py from :mod:`teleop_core.graph.topics`; change that, not this file. A
stage has the fields of its own topics alone: a kernel that asks for another one does not compile.
"""

from teleop_core.kernels.fields import Fields
from teleop_core.kernels.geometry import Array


class Row(Fields):
    """Newest value of each topic, as its kind has it, and its stamp [ns]."""

    now_ns: int
    answered_ns: int
    hand_servo_cp: Array
    hand_servo_cp_ns: int
    master_measured_cp: Array
    master_measured_cp_ns: int
    master_measured_cv: Array
    master_measured_cv_ns: int
    master_measured_cf: Array
    master_measured_cf_ns: int
    master_buttons: Array
    master_buttons_ns: int
    master_contact: Array
    master_contact_ns: int
    master_servo_cf: Array
    master_servo_cf_ns: int
    slave_servo_cp: Array
    slave_servo_cp_ns: int
    slave_servo_jp: Array
    slave_servo_jp_ns: int
    slave_reach: Array
    slave_reach_ns: int
    slave_setpoint_js: Array
    slave_setpoint_js_ns: int
    slave_setpoint_cp: Array
    slave_setpoint_cp_ns: int
    slave_measured_js: Array
    slave_measured_js_ns: int
    slave_measured_cp: Array
    slave_measured_cp_ns: int
    slave_true_cp: Array
    slave_true_cp_ns: int
    hand_buttons: Array
    hand_buttons_ns: int
    hand_tremor: Array
    hand_tremor_ns: int
    slave_measured_cf: Array
    slave_measured_cf_ns: int
    slave_estimated_cf: Array
    slave_estimated_cf_ns: int
    slave_true_cf: Array
    slave_true_cf_ns: int
    slave_operation: Array
    slave_operation_ns: int
    teleop_state: Array
    teleop_state_ns: int
    network_servo_cp: Array
    network_servo_cp_ns: int
    network_setpoint_cp: Array
    network_setpoint_cp_ns: int
    network_measured_cp: Array
    network_measured_cp_ns: int
    network_measured_cf: Array
    network_measured_cf_ns: int
    network_reach: Array
    network_reach_ns: int
    network_state: Array
    network_state_ns: int
    master_energy: Array
    master_energy_ns: int
    slave_energy: Array
    slave_energy_ns: int
    passivity_servo_cp: Array
    passivity_servo_cp_ns: int
    network_master_energy: Array
    network_master_energy_ns: int
    network_slave_energy: Array
    network_slave_energy_ns: int
    slave_servo_cf: Array
    slave_servo_cf_ns: int
    network_servo_cf: Array
    network_servo_cf_ns: int
    impedance_servo_cp: Array
    impedance_servo_cp_ns: int
    master_filtered_cp: Array
    master_filtered_cp_ns: int
    master_filtered_out: Array
    master_filtered_out_ns: int
    remote_centre_servo_cp: Array
    remote_centre_servo_cp_ns: int
    remote_centre_place: Array
    remote_centre_place_ns: int
    hand_jaw: Array
    hand_jaw_ns: int
    slave_jaw_servo_jp: Array
    slave_jaw_servo_jp_ns: int
    network_jaw_servo_jp: Array
    network_jaw_servo_jp_ns: int
    slave_jaw_setpoint_js: Array
    slave_jaw_setpoint_js_ns: int
    slave_jaw_measured_js: Array
    slave_jaw_measured_js_ns: int
    slave_jaw_grip: Array
    slave_jaw_grip_ns: int
    slave_jaw_object_cp: Array
    slave_jaw_object_cp_ns: int
    slave_jaw_board: Array
    slave_jaw_board_ns: int
    scene_poses: Array
    scene_poses_ns: int
    scene_energy: Array
    scene_energy_ns: int
    display_measured_cp: Array
    display_measured_cp_ns: int
    task_state: Array
    task_state_ns: int
    first_slave_jaw_board: Array
    first_slave_jaw_board_ns: int
    first_slave_jaw_grip: Array
    first_slave_jaw_grip_ns: int
    second_slave_true_cp: Array
    second_slave_true_cp_ns: int
    second_slave_jaw_grip: Array
    second_slave_jaw_grip_ns: int
