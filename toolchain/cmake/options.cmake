# Compiler options that every target shares, and the one way to declare a library or a test.

add_library(booth_options INTERFACE)
target_include_directories(booth_options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(booth_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor> $<$<COMPILE_LANGUAGE:CXX>:-Woverloaded-virtual>
  -Wno-psabi
  # The same bits in debug and release and on every x86-64: no fused multiply-add that the source does not ask for.
  -ffp-contract=off)
# One alignment in every translation unit and in every library that was built against Eigen, whatever -m flags a file gets.
# Eigen cuts large products into blocks by the sizes of the processor's caches, and with them the order of its sums: without its look at the processor
# every machine cuts alike and gives the same bits.
target_compile_definitions(booth_options INTERFACE EIGEN_MAX_ALIGN_BYTES=16 EIGEN_NO_CPUID EIGEN_MPL2_ONLY)
# Addresses of libraries' functions are resolved at the start and read-only from then on, in every build; the packages' further hardening: toolchain/package.
target_link_options(booth_options INTERFACE LINKER:-z,relro,-z,now)
if(BOOTHD_WERROR)
  target_compile_options(booth_options INTERFACE -Werror)
endif()
if(BOOTHD_SANITIZE)
  target_compile_options(booth_options INTERFACE -fsanitize=${BOOTHD_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(booth_options INTERFACE -fsanitize=${BOOTHD_SANITIZE})
  target_compile_definitions(booth_options INTERFACE BOOTHD_SANITIZED)
endif()

# booth_library(name SOURCES... [LINK libs...] [PRIVATE_LINK libs...])
function(booth_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK;PRIVATE_LINK" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC booth_options ${ARG_LINK} PRIVATE ${ARG_PRIVATE_LINK})
endfunction()

# booth_test(name SOURCES... [LINK libs...] [LABELS labels...] [TIMEOUT seconds]): a GoogleTest program whose cases ctest knows one by one.
function(booth_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LINK;LABELS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE booth_options ${ARG_LINK} GTest::gtest GTest::gmock GTest::gtest_main)
  target_compile_definitions(${name} PRIVATE
    BOOTH_SOURCE_DIR="${PROJECT_SOURCE_DIR}"           # committed fixtures and models
    BOOTH_BINARY_DIR="${PROJECT_BINARY_DIR}")
  gtest_discover_tests(${name} TEST_PREFIX "${name}." DISCOVERY_MODE PRE_TEST NO_PRETTY_VALUES PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}")
endfunction()
