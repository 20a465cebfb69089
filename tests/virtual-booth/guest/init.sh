#!/bin/bash
# First process of the guest: lays a writable layer in memory over the host's files, runs one scenario and powers off.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb LC_ALL=C.UTF-8

# The kernel hands unknown words of its command line on as environment: BOOTH_SCENARIO, BOOTH_BUILD, BOOTH_ROOMS (tests/virtual-booth), BOOTH_FOLDER (the host's, for
# what is to survive the guest), and what the caller had in BOOTH_TIMES and the like.
mount -t tmpfs -o mode=755 layer /mnt
mkdir /mnt/upper /mnt/work /mnt/root
mount -t overlay -o lowerdir=/,upperdir=/mnt/upper,workdir=/mnt/work overlay /mnt/root || echo "why: no writable layer over the host's files"
cd /mnt/root || exit 1
mount -t proc proc proc
mount -t sysfs sys sys
mount -t devtmpfs dev dev
mkdir -p dev/pts dev/shm
mount -t devpts devpts dev/pts
mount -t tmpfs shm dev/shm
mount -t tmpfs run run
mount -t configfs config sys/kernel/config
mount -t debugfs debug sys/kernel/debug
mount -t cgroup2 cgroup sys/fs/cgroup
mkdir -p run/booth run/host
mount -t hostfs -o "$BOOTH_FOLDER/shared" host run/host && export BOOTH_FOLDER=/run/host

# The guest expands these, not this script.
# shellcheck disable=SC2016
chroot . /bin/bash -c '
  cd /run/booth
  ip link set lo up 2>/dev/null
  . "$BOOTH_ROOMS/guest/functions.sh"
  . "$BOOTH_SCENARIO"
' </dev/null
echo "BOOTH-RESULT $?"
sync
SYSTEMD_IGNORE_CHROOT=1 chroot . /sbin/poweroff -f -f
