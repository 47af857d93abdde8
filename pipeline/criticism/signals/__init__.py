"""What the sensors of a machine show: true state, voltages, torque of the shaft."""
