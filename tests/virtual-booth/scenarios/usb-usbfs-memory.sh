# Scenario: the kernel's limit of USB memory.
# does: with the kernel's default of 16 MB a camera refuses with a sentence that names the setting, with 256 MB four cameras start
# kernel: usbcore.usbfs_memory_mb=16 time-travel=inf-cpu
# limit: 150
# needs: usb_cameras
set -eu
start_udev
"$programs/usb_cameras" memory-short
echo 256 >/sys/module/usbcore/parameters/usbfs_memory_mb
"$programs/usb_cameras" memory-enough
