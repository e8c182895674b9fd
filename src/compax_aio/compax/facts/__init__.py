"""
What is known of the COMPAX, as frozen tables with pages; parser, client, simulator and documents read these.

Sources, as named in the tables: UG is the COMPAX-M/-S User Guide (192-040053 N2, Oct 2001); IBS the Interbus-S
interface manual (Jan 2000); CAN and CAN-S the CANopen manual, editions 02xxM and COMPAX-S; 485 the RS485 option
manual. ``Certainty`` says how well a row is founded.
"""
