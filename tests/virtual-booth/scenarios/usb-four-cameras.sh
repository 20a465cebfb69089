# Scenario: four cameras at once.
# does: four SuperSpeed cameras stream through usbfs, libusb and the Kinect v2 driver, and nothing is lost
# kernel: usbcore.usbfs_memory_mb=256 time-travel=inf-cpu
# limit: 150
# needs: usb_cameras
# In virtual time: the guest's clock stands still while anything computes, so that the figures say what was lost and not how busy the host is.
set -eu
start_udev
"$programs/usb_cameras" four 30 2
