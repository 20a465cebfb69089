# Scenario: cables that are pulled.
# does: a camera comes back after an unplug at each request of open, start and stop and while it streams; another camera does not notice
# kernel: usbcore.usbfs_memory_mb=256
# limit: 150
# needs: usb_cameras
set -eu
start_udev
"$programs/usb_cameras" unplug
