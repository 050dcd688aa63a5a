"""Drivers of the bench: an NDI Aurora tracker on a serial port, stepper terminals on EtherCAT."""
