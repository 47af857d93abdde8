"""Numbers of a motor datasheet that captures do not give, with the test that would."""

from __future__ import annotations

from pipeline.records.performance import Blank, Operation

NO_CONDITIONS = Blank(
    "operation",
    "bus voltage and current limit",
    "no capture has dq voltages and currents, and none are stated",
    "operate.vdc_v= and operate.current_a=",
)
IRON = Blank(
    "iron_loss_w",
    "iron loss by itself",
    "a coast with open terminals takes friction, windage and the magnet's iron loss together",
    "spin_down with an unmagnetised or dummy rotor (IEEE Std 1812-2014)",
)
STRAY = Blank(
    "additional_load_loss_w",
    "additional load loss",
    "iron and skin-effect loss that grow with current are in no test without input power",
    "torque_map with vd_v, vq_v at several speeds against shaft power (IEC 60034-2-1, 2-1-2A)",
)
SWITCHING = Blank(
    "inverter_switching_w",
    "switching loss of the inverter",
    "it is the inverter's own, and no capture of the motor shows it",
    "drive with idc_a and vdc_v beside vd_v, vq_v, id_a, iq_a",
)
CONDUCTION = Blank(
    "inverter_w",
    "conduction loss of the inverter",
    "what a device drops is not stated",
    "operate.drop_v= and operate.on_ohm= from the inverter's data",
)


def losses_not_known(operation: Operation) -> tuple[Blank, ...]:
    """Parts of the loss that captures of a motor do not separate.

    Parameters
    ----------
    operation
        Conduction loss is known where it states a drop or resistance of the devices.

    Returns
    -------
    tuple of Blank
        Iron, stray and switching loss, and conduction loss where it is not known.

    """
    stated = operation.drop_v is not None or operation.on_ohm is not None
    return (IRON, STRAY, SWITCHING) if stated else (IRON, STRAY, CONDUCTION, SWITCHING)
