// Files that are opened, looked at and only then believed.
#include "drivers/usb/recover_request.hpp"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <system_error>
#include <thread>
#include <utility>

namespace booth::drivers::usb {
namespace {

using namespace std::chrono_literals;
using Result = PowerOutcome::Result;

constexpr std::size_t kLongestRequest = 64, kLongestAnswer = 512;
constexpr time_t kFreshSeconds = 60;
constexpr hal::Nanoseconds kLook = 100ms;
constexpr std::array<std::pair<RecoverStep, std::string_view>, 3> kSteps{
    {{RecoverStep::port, "port"}, {RecoverStep::controller, "controller"}, {RecoverStep::usbfs_memory, "usbfs-memory"}}};
constexpr std::array<std::pair<Result, std::string_view>, 4> kResults{
    {{Result::done, "done"}, {Result::not_permitted, "not_permitted"}, {Result::refused, "refused"}, {Result::failed, "failed"}}};

/// A file descriptor that closes itself.
class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() {
    if (fd_ >= 0) ::close(fd_);
  }
  Fd(const Fd&) = delete;
  operator int() const { return fd_; }

 private:
  const int fd_;
};

std::string why() { return std::generic_category().message(errno); }

Fd open_folder(const std::filesystem::path& path) { return Fd(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW)); }

/// The text of a plain file of at most `longest` bytes; nothing for anything else.
std::optional<std::string> read_small(int folder, const std::string& name, std::size_t longest, bool fresh) {
  const Fd file(::openat(folder, name.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat s {};
  if (file < 0 || ::fstat(file, &s) != 0 || !S_ISREG(s.st_mode) || s.st_size < 0 || static_cast<std::size_t>(s.st_size) > longest) return {};
  if (fresh && std::abs(::time(nullptr) - s.st_mtime) > kFreshSeconds) return {};
  std::string text(longest, '\0');
  const ssize_t n = ::read(file, text.data(), text.size());
  if (n < 0) return {};
  text.resize(static_cast<std::size_t>(n));
  return text;
}

/// Under another name first, so that nobody reads half of it.
bool write_whole(int folder, const std::string& name, const std::string& text, mode_t mode) {
  const std::string part = "." + name + ".part";
  (void)::unlinkat(folder, part.c_str(), 0);
  const Fd file(::openat(folder, part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode));
  return file >= 0 && ::fchmod(file, mode) == 0 && ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
         ::renameat(folder, part.c_str(), folder, name.c_str()) == 0;
}

PowerOutcome take_step(RecoverStep step, const std::string& argument, PowerControl& power) {
  switch (step) {
    case RecoverStep::port:
      return power.reset_port(argument);
    case RecoverStep::controller:
      return power.rebind_controller_at(argument);
    case RecoverStep::usbfs_memory:
      return power.raise_usbfs_memory(argument);
  }
  return {Result::refused, "no such step"};
}

std::string fresh_number() {
  std::uint64_t bits = 0;
  if (::getrandom(&bits, sizeof bits, 0) != static_cast<ssize_t>(sizeof bits)) bits = static_cast<std::uint64_t>(::time(nullptr));
  std::array<char, 16> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), bits, 16).ptr;
  return {text.data(), end};
}

}  // namespace

std::string_view to_string(RecoverStep step) {
  for (const auto& [s, name] : kSteps)
    if (s == step) return name;
  return "?";
}

std::optional<RecoverStep> parse_recover_step(std::string_view text) {
  for (const auto& [step, name] : kSteps)
    if (name == text) return step;
  return {};
}

std::optional<RecoverRequest> parse_recover_request(std::string_view text) {
  if (text.size() > kLongestRequest || text.empty() || text.back() != '\n') return {};
  text.remove_suffix(1);
  const auto space = text.find(' ');
  if (space == std::string_view::npos) return {};
  const auto hexadecimal = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  const auto of_a_name = [&](char c) { return hexadecimal(c) || c == '-' || c == '.' || c == ':'; };
  const std::string_view number = text.substr(0, space), argument = text.substr(space + 1);
  if (number.empty() || number.size() > 16 || !std::all_of(number.begin(), number.end(), hexadecimal)) return {};
  if (argument.empty() || !std::all_of(argument.begin(), argument.end(), of_a_name)) return {};
  return RecoverRequest{std::string(number), std::string(argument)};
}

PowerOutcome answer_recover_request(RecoverStep step, const std::filesystem::path& requests, const std::filesystem::path& answers, PowerControl& power) {
  const std::string name(to_string(step));
  const Fd in = open_folder(requests), out = open_folder(answers);
  if (in < 0) return {Result::failed, requests.string() + " cannot be opened as a folder: " + why()};
  const auto text = read_small(in, name, kLongestRequest, true);
  // Deleted first, whatever it is: else the same request would come again and again.
  if (::unlinkat(in, name.c_str(), 0) != 0 && errno != ENOENT) return {Result::failed, (requests / name).string() + " cannot be deleted: " + why()};
  const auto request = text ? parse_recover_request(*text) : std::nullopt;
  if (!request) return {Result::refused, (requests / name).string() + " is no fresh, well-formed request"};
  PowerOutcome outcome = take_step(step, request->argument, power);
  const auto result = std::find_if(kResults.begin(), kResults.end(), [&](const auto& r) { return r.first == outcome.result; });
  const std::string answer = (request->number + " " + std::string(result->second) + " " + outcome.sentence).substr(0, kLongestAnswer - 1) + "\n";
  if (out < 0 || !write_whole(out, name, answer, 0640))
    return {Result::failed, outcome.sentence + "; and the answer could not be written to " + answers.string()};
  return outcome;
}

RecoverClient::RecoverClient(std::filesystem::path requests, std::filesystem::path answers, hal::Nanoseconds patience,
                             std::function<void(hal::Nanoseconds)> pause)
    : requests_(std::move(requests)),
      answers_(std::move(answers)),
      patience_(patience),
      pause_(pause ? std::move(pause) : [](hal::Nanoseconds t) { std::this_thread::sleep_for(t); }) {}

PowerOutcome RecoverClient::ask(RecoverStep step, const std::string& argument) {
  const std::lock_guard lock(mutex_);
  const std::string name(to_string(step)), number = fresh_number(), text = number + " " + argument + "\n";
  if (!parse_recover_request(text)) return {Result::refused, "\"" + argument.substr(0, 32) + "\" cannot be asked for"};
  // The group, in which the answerer is, must be able to delete what lies in the folder.
  if (::mkdir(requests_.c_str(), 0770) != 0 && errno != EEXIST) return {Result::failed, requests_.string() + " cannot be made: " + why()};
  const Fd folder = open_folder(requests_);
  if (folder < 0 || ::fchmod(folder, 0770) != 0 || !write_whole(folder, name, text, 0640))
    return {Result::failed, "a request cannot be written to " + requests_.string() + ": " + why()};
  for (hal::Nanoseconds waited{0}; waited < patience_; waited += kLook) {
    pause_(kLook);
    const Fd answers = open_folder(answers_);
    const auto answer = answers < 0 ? std::nullopt : read_small(answers, name, kLongestAnswer, false);
    if (!answer || !answer->starts_with(number + " ")) continue;
    const std::string rest = answer->substr(number.size() + 1);
    for (const auto& [result, word] : kResults)
      if (rest.starts_with(std::string(word) + " ")) return {result, rest.substr(word.size() + 1, rest.size() - word.size() - 2)};
  }
  (void)::unlinkat(folder, name.c_str(), 0);
  return {Result::not_permitted, "nobody who may answered the request for " + name + " " + argument + " (boothd-usb-recover@" + name + ".path)"};
}

}  // namespace booth::drivers::usb
