// Counts every allocation of the test program, on every thread, so that "allocates nothing" is a test and not a promise.
#pragma once

namespace booth::tests {

long allocations();

/// Allocations since this object was made.
class NoAllocation {
 public:
  NoAllocation() : before_(allocations()) {}
  long count() const { return allocations() - before_; }

 private:
  long before_;
};

}  // namespace booth::tests
