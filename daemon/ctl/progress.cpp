// Stderr alone decides: the result on stdout may go into a file while somebody waits for it.
#include "daemon/ctl/progress.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <iostream>

namespace booth::daemon {

void say_step(const std::string& what) {
  if (::isatty(STDERR_FILENO) != 0) std::cerr << what << " ...\n";
}

ProgressLine::ProgressLine() : terminal_(::isatty(STDERR_FILENO) != 0) {}

void ProgressLine::show(const std::string& text) {
  if (!terminal_ || text == shown_) return;
  // What is longer than the terminal is wide goes on in the next line, where it could not be taken back.
  winsize size{};
  const bool known = ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1;
  std::cerr << "\r" << text.substr(0, known ? size.ws_col - 1u : text.size()) << "\033[K" << std::flush;
  shown_ = text;
}

void ProgressLine::clear() {
  if (!shown_.empty()) std::cerr << "\r\033[K" << std::flush;
  shown_.clear();
}

}  // namespace booth::daemon
