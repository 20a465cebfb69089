# Scenario: the emulated sensor's descriptors.
# does: a real kernel enumerates the sensor, and libusb reads its strings, its SuperSpeed companion and its capabilities
# limit: 30
# needs: usb_descriptors
set -eu
"$programs/usb_descriptors"
