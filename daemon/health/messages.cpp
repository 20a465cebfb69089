// The table of messages, and the page that is made from it.
#include "daemon/health/messages.hpp"

#include <array>

namespace booth::daemon {
namespace {

constexpr std::array<MessageEntry, 18> kMessages{{
    {Message::ready, "a1f631195cdc4a6dabf355ea22d04eef", "ready", "boothd has started and takes sessions.", "Nothing."},
    {Message::stopping, "cc9c1973756f462da8a49b52c89a1736", "stopping", "boothd was told to stop; a session that runs is saved.", "Nothing."},
    {Message::configuration_wrong, "6cbc0ff2a37b43c68f8bbae6a8eec657", "configuration wrong",
     "boothd does not start: its configuration has a mistake. One message for each mistake.",
     "`boothd --check-config` shows all of them; mend the file and line that it names, then `systemctl restart boothd`."},
    {Message::start_failed, "df63dca816d1489abc9a332debffcc66", "start failed", "boothd does not start: something that it needs is missing.",
     "The sentence names it. It is tried again by itself; if it stays, `boothctl doctor`."},
    {Message::internal_fault, "dbd5873bcfc14395a89e28db5671d48f", "internal fault", "boothd ends because of something that must not happen.",
     "It starts again by itself. Report the sentence, with the newest snapshot below `record.directory`."},
    {Message::thread_stalled, "b9a6644169f948d0813533f83e68ebad", "thread stalled",
     "A thread of the pipeline stood still for ten seconds; boothd ends and is started again.",
     "Once: nothing. Again: `boothctl doctor`, and `systemd-cgtop` for what else takes the processor."},
    {Message::camera_changed, "12d56e6cffee49379620f187d0388de6", "camera changed", "A camera starts, delivers, or has come to its end.", "Nothing."},
    {Message::camera_lost, "9e0dd131d6624f1c8ebde46829dea822", "camera lost",
     "A camera does not deliver; boothd tries to get it back. The same trouble is told again after ten minutes.",
     "If it stays: `boothctl doctor`; unplug the sensor from mains and USB for ten seconds."},
    {Message::camera_moved, "b264e53035a54b578338f237f45d6790", "camera moved",
     "By the people who were captured, a camera does not stand any more where the calibration says; as information: it does again.",
     "Look at the camera that is named: its mount, and what stands before it. Then calibrate anew, or `boothctl calibrate --from-person`."},
    {Message::backend_changed, "4ccdd4ee37f945b1af8b7339072ac108", "backend changed",
     "Another device than before computes the fit or decodes a camera's depth; as a warning: not the one that is configured.",
     "As a warning: look at the graphics processor (`nvidia-smi`, the kernel's log). boothd goes on with the CPU and tries it again."},
    {Message::panel_problem, "2f45c6a3bf844dbd8ccbe1d1f6173c34", "panel problem", "A button or lamp is in trouble; as information: they work again.",
     "The sentence names the line: missing chip, line in use by another program, a button that is stuck or chatters."},
    {Message::credentials_expire, "f5affec53d4b4af5bd8e2ca8cda4bf4f", "credentials expire", "The credentials for DDS Security expire soon or have expired.",
     "Issue new ones (`boothctl security issue`) and restart boothd."},
    {Message::session_began, "b72a73c6315c4e61bd2d4a400e932170", "session began", "A session begins.", "Nothing."},
    {Message::session_complete, "c1c121d98e21486abed8840c232f9f72", "session complete", "A session has ended and its files are whole.", "Nothing."},
    {Message::session_not_saved, "6caa9f71cf25427689bc3f44a851fe0b", "session not saved", "A session could not be written, wholly or in part.",
     "The sentence has the system's reason: a full disk or a folder that does not belong to `boothd`. It goes with the next session that is saved."},
    {Message::system_call_refused, "9122c75a7e2846a2b9a960026b6074c2", "system call refused",
     "Something in boothd asked for a system call that is not in its list. Told once for each call.",
     "After an update: report it. Without an update: treat the box as attacked."},
    {Message::given_up, "cb1823dfbdaf410ea0e9ab2b16499cd6", "given up", "boothd has failed and is not started again.",
     "The last error before it says why. Mend that, then `systemctl reset-failed boothd; systemctl restart boothd`."},
    {Message::newer_file, "2c113eb18ff3462c9069c72d0b256568", "newer file",
     "boothd reads a file of its next version; what it does not know in there has no effect. So it is after an update that was taken back.",
     "Nothing, if that is what happened; otherwise the file's `version` is wrong."},
}};

}  // namespace

std::span<const MessageEntry> messages() { return kMessages; }
const MessageEntry& entry_of(Message message) { return kMessages[static_cast<std::size_t>(message)]; }

std::string messages_page() {
  std::string page =
      "# Messages in the journal\n\n"
      "Made from daemon/health/messages.cpp by tests/house/reference_test.cpp; do not edit.\n\n"
      "What an operator may have to act upon has a `MESSAGE_ID`, which stays the same when the sentence changes: `journalctl MESSAGE_ID=ID`. Everything else "
      "that\n"
      "boothd says has none, and so has every message where stderr is not the journal or the journal does not take it.\n\n"
      "| message | MESSAGE_ID | what has happened | what to do |\n|---|---|---|---|\n";
  for (const MessageEntry& m : kMessages)
    page += "| " + std::string(m.name) + " | `" + std::string(m.id) + "` | " + std::string(m.meaning) + " | " + std::string(m.remedy) + " |\n";
  return page;
}

}  // namespace booth::daemon
