// malloc of this program counts and hands on to glibc's; operator new and Eigen both come through here.
#include "tests/support/allocation_count.hpp"

#include <execinfo.h>
#include <link.h>
#include <sys/prctl.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace {

enum Kind { kUnknown = -1, kOther, kFrame, kCamera };

std::atomic<std::uint64_t> counts[3][2];

struct Span {
  std::uintptr_t begin, end;
};
std::array<Span, 8> excused_spans;
std::atomic<int> excused_count{0};

struct Place {
  char thread[16];
  void* stack[24];
  int depth;
};
std::array<Place, 6> places;
std::atomic<int> place_count{0};
std::atomic<bool> watching{false};

thread_local int kind_of_thread = kUnknown;
thread_local bool inside = false;  // backtrace() may allocate

Kind look_up_kind(char (&name)[16]) {
  ::prctl(PR_GET_NAME, name, 0, 0, 0);
  return std::strncmp(name, "frame-cam", 9) == 0 ? kCamera : std::strncmp(name, "frame-", 6) == 0 ? kFrame : kOther;
}

[[maybe_unused]] void note(void* caller) {
  if (inside) return;
  inside = true;
  char name[16] = {};
  if (kind_of_thread == kUnknown) kind_of_thread = look_up_kind(name);
  const auto address = reinterpret_cast<std::uintptr_t>(caller);
  bool excused = false;
  for (int i = 0; i < excused_count.load(std::memory_order_acquire); ++i)
    excused = excused || (address >= excused_spans[static_cast<std::size_t>(i)].begin && address < excused_spans[static_cast<std::size_t>(i)].end);
  counts[kind_of_thread][excused].fetch_add(1, std::memory_order_relaxed);
  if (kind_of_thread != kOther && !excused && watching.load(std::memory_order_acquire)) {
    const int at = place_count.fetch_add(1);
    if (at < static_cast<int>(places.size())) {
      Place& place = places[static_cast<std::size_t>(at)];
      (void)look_up_kind(name);
      std::memcpy(place.thread, name, sizeof name);
      place.depth = ::backtrace(place.stack, 24);
    }
  }
  inside = false;
}

int add_span(dl_phdr_info* info, std::size_t, void* wanted) {
  const char* slash = std::strrchr(info->dlpi_name, '/');
  const char* name = slash ? slash + 1 : info->dlpi_name;
  const auto* prefix = static_cast<const char*>(wanted);
  if (std::strncmp(name, prefix, std::strlen(prefix)) != 0) return 0;
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const auto& header = info->dlpi_phdr[i];
    if (header.p_type != PT_LOAD || !(header.p_flags & PF_X)) continue;
    const int at = excused_count.load();
    if (at == static_cast<int>(excused_spans.size())) return 1;
    const std::uintptr_t begin = info->dlpi_addr + header.p_vaddr;
    excused_spans[static_cast<std::size_t>(at)] = {begin, begin + header.p_memsz};
    excused_count.store(at + 1, std::memory_order_release);
  }
  return 0;
}

}  // namespace

namespace booth::tests {

AllocationCount::AllocationCount(std::initializer_list<const char*> excused) {
  excused_count = 0;
  for (const char* library : excused) ::dl_iterate_phdr(add_span, const_cast<char*>(library));
  void* warm[4];
  (void)::backtrace(warm, 4);  // its first call loads a library
  place_count = 0;
  watching = true;
  start_ = totals();
}

AllocationCount::~AllocationCount() {
  watching = false;
  excused_count = 0;
}

AllocationCount::Totals AllocationCount::totals() {
  Totals out;
  for (int k = 0; k < 3; ++k)
    for (int e = 0; e < 2; ++e) out.of[k][e] = counts[k][e].load();
  return out;
}

std::uint64_t AllocationCount::so_far() const {
  const Totals now = totals();
  std::uint64_t sum = 0;
  for (int k = 0; k < 3; ++k) sum += now.of[k][0] - start_.of[k][0];
  return sum;
}
std::uint64_t AllocationCount::on_frame_threads() const { return totals().of[kFrame][0] - start_.of[kFrame][0]; }
std::uint64_t AllocationCount::on_camera_threads() const { return totals().of[kCamera][0] - start_.of[kCamera][0]; }
std::uint64_t AllocationCount::excused_on_frame_threads() const {
  const Totals now = totals();
  return now.of[kFrame][1] - start_.of[kFrame][1] + now.of[kCamera][1] - start_.of[kCamera][1];
}

std::string AllocationCount::first_places() const {
  std::string out;
  for (int i = 0; i < std::min<int>(place_count, static_cast<int>(places.size())); ++i) {
    const Place& place = places[static_cast<std::size_t>(i)];
    out += std::string(place.thread) + ":\n";
    char** names = ::backtrace_symbols(place.stack, place.depth);
    for (int f = 0; names && f < place.depth; ++f) out += std::string("    ") + names[f] + "\n";
    std::free(names);
  }
  return out;
}

}  // namespace booth::tests

#if defined(BOOTHD_SANITIZED) || !defined(__GLIBC__)

bool booth::tests::AllocationCount::supported() { return false; }

#else

bool booth::tests::AllocationCount::supported() { return true; }

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  note(__builtin_return_address(0));
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  note(__builtin_return_address(0));
  return __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t size) {
  note(__builtin_return_address(0));
  return __libc_realloc(old, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  note(__builtin_return_address(0));
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note(__builtin_return_address(0));
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  note(__builtin_return_address(0));
  *out = __libc_memalign(alignment, size);
  return *out ? 0 : ENOMEM;
}
}

#endif
