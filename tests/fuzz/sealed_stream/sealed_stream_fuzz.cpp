// A sealed file that somebody worked on: whatever was cut, changed, doubled or moved, what is handed out is a beginning of what was sealed, and "complete"
// is said of the whole alone; arbitrary bytes, keys and key files among them, are sentences and no crashes.
#include <algorithm>
#include <stdexcept>
#include <string>

#include "daemon/seal/seal.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::require;

SealDecoder::Source source_of(const std::string& bytes) {
  return [&bytes, at = std::size_t{0}](char* to, std::size_t count) mutable {
    const std::size_t n = std::min(count, bytes.size() - at);
    std::copy_n(bytes.data() + at, n, to);
    at += n;
    return n;
  };
}

const PrivateKey& key() {
  static const PrivateKey k = make_private_key();
  return k;
}

const Seal& seal() {
  static const auto s = Seal::fresh(key().public_half);
  return *s;
}

/// At most eight chunks of sizes that the input names.
std::string sealed(booth::fuzz::Input& in, std::string& plain) {
  SealEncoder encoder(seal(), "f");
  std::string out, chunk;
  const int count = 1 + in.u8() % 8;
  for (int i = 0; i < count; ++i) {
    chunk.assign(in.u16() % 700, static_cast<char>('a' + i));
    plain += chunk;
    encoder.append(chunk, i + 1 == count, out);
  }
  return out;
}

void work_on(booth::fuzz::Input& in, std::string& bytes) {
  for (int edits = in.u8() % 4; edits > 0 && !bytes.empty(); --edits) {
    const std::size_t at = in.u16() % bytes.size(), count = in.u16() % (bytes.size() - at + 1), to = in.u16() % bytes.size();
    switch (in.u8() % 5) {
      case 0:
        bytes[at] = static_cast<char>(in.u8());
        break;
      case 1:
        bytes.resize(at);
        break;
      case 2:
        bytes.erase(at, count);
        break;
      case 3:
        bytes.insert(to, bytes.substr(at, count));
        break;
      default:
        bytes.replace(at, std::min(count, bytes.size() - at), std::string(count, '\0'));
    }
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string raw(reinterpret_cast<const char*>(data), size);
  booth::fuzz::Input in(data, size);
  std::string plain;
  const std::string whole = sealed(in, plain);
  std::string bytes = whole;
  work_on(in, bytes);

  SealDecoder decoder(seal(), "f", source_of(bytes));
  std::string read;
  for (std::string chunk; decoder.next(chunk);) read += chunk;
  require(decoder.end() != SealEnd::open, "a file has an end");
  require(plain.starts_with(read), "what is handed out was sealed, in its order");
  require((decoder.end() == SealEnd::complete) == (bytes == whole), "only the whole is complete");
  require(decoder.offset() <= bytes.size(), "the place lies in the file");
  (void)sealed_plain_bytes(source_of(bytes));

  for (const std::string& begin : {std::string(), whole.substr(0, 32)}) {
    const std::string any = begin + raw;
    SealDecoder stranger(seal(), "f", source_of(any));
    std::string chunk;
    require(!stranger.next(chunk), "nobody makes chunks without the key");
    require(sealed_plain_bytes(source_of(any)) <= any.size(), "sizes that are believed are there");
  }
  for (const std::string& file : {raw, "boothky1" + key().public_half.id() + raw}) {
    try {
      (void)Seal::open(file, key(), "x");
      require(false, "nobody makes a key file without being asked");
    } catch (const std::runtime_error& e) {
      require(std::string(e.what()).starts_with("x: "), "the sentence names the file");
    }
  }
  for (const std::string& text : {raw, "boothd-public-1 " + raw}) {
    try {
      (void)parse_public_key(text, "x");
    } catch (const std::runtime_error& e) {
      require(std::string(e.what()).starts_with("x: "), "the sentence names the file");
    }
  }
  return 0;
}
