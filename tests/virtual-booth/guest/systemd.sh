#!/bin/bash
# First process of a guest that boots as a box does: boothd's package goes into the layer above the host's files, then systemd runs on it.
# BOOTH_PACKAGES: folder with the packages, or with the tree that `cmake --install` made, where they were not built.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb LC_ALL=C.UTF-8
give_up() { echo "why: $*"; echo "BOOTH-RESULT 1"; /sbin/poweroff -f -f; }

mount -t tmpfs -o mode=755 layer /mnt
mkdir /mnt/upper /mnt/work /mnt/root
mount -t overlay -o lowerdir=/,upperdir=/mnt/upper,workdir=/mnt/work overlay /mnt/root || give_up "no writable layer over the host's files"
cd /mnt/root || exit 1
mount -t proc proc proc
mount -t devtmpfs dev dev
for word in BOOTH_SCENARIO BOOTH_BUILD BOOTH_ROOMS BOOTH_PACKAGES BOOTH_TIMES; do [ -n "${!word}" ] && echo "$word=${!word}"; done >etc/booth-guest.env
echo "BOOTH_FOLDER=/var/booth-host" >>etc/booth-guest.env
mkdir -p var/booth-host
mount -t hostfs -o "$BOOTH_FOLDER/shared" host var/booth-host
: >var/booth-host/booted

# A box has nothing but Debian and boothd: no other service of the host, none of its disks.
rm -rf .dockerenv etc/systemd/system/*.wants etc/systemd/system/default.target var/lib/boothd etc/boothd
: >etc/fstab
# Nobody logs in, there is no screen, and no module: what looks after them would take the guest a third of its boot.
ln -s /lib/systemd/system/multi-user.target etc/systemd/system/default.target
for unit in systemd-logind dbus systemd-user-sessions systemd-update-utmp systemd-update-utmp-runlevel systemd-binfmt systemd-modules-load systemd-random-seed modprobe@; do
  ln -sf /dev/null etc/systemd/system/$unit.service
done
for unit in dbus.socket proc-sys-fs-binfmt_misc.automount; do ln -sf /dev/null etc/systemd/system/$unit; done
# /tmp is not emptied at the start: the source tree may lie there.
mkdir -p etc/tmpfiles.d && : >etc/tmpfiles.d/tmp.conf
echo booth >etc/hostname
printf '127.0.0.1 localhost\n127.0.1.1 booth\n' >etc/hosts
echo 11111111111111111111111111111111 >etc/machine-id

install_package() {
  if ls "$BOOTH_PACKAGES"/boothd_*.deb >/dev/null 2>&1; then
    # What it depends on is there, because it was built here.
    chroot . dpkg --force-unsafe-io --force-confnew --no-triggers -i "$BOOTH_PACKAGES"/boothd_*.deb "$BOOTH_PACKAGES"/boothd-models_*.deb
  else
    # In the new root: the modes of folders are set by way of its /proc.
    tar -C "$BOOTH_PACKAGES" -c . | chroot . tar -x -C / --keep-directory-symlink --no-same-owner && chroot . sh -c 'systemd-sysusers boothd.conf && systemctl enable boothd.service'
  fi
}
install_package >/dev/null 2>/mnt/install.log || { cat /mnt/install.log; give_up "boothd cannot be installed"; }

for unit in "$BOOTH_ROOMS"/guest/units/*.service; do
  install -m 644 "$unit" etc/systemd/system/
  mkdir -p etc/systemd/system/multi-user.target.wants
  ln -sf "../$(basename "$unit")" etc/systemd/system/multi-user.target.wants/
done
umount proc dev
# As switch_root does: a process that was merely put into another root may make no user namespace.
mount --move . / 2>/dev/null
exec chroot . /sbin/init
