// The bag as a sink, and the choice between it and the sealed one.
#include "drivers/recording/recording_sink.hpp"

#include "drivers/recording/sealed_recording.hpp"

namespace booth::drivers {
namespace {

class BagSink final : public RecordingSink {
 public:
  BagSink(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras, const std::vector<hal::DepthFrame>& background,
          BagContents contents)
      : writer_(path, cameras, {}, background, contents) {}
  void depth(std::size_t camera, std::span<const std::byte> packed, hal::UtcTime utc) override { writer_.write_packed(camera, packed, utc); }
  void group(const hal::FittedGroup& group, hal::Nanoseconds utc_offset) override { writer_.write_group(group, utc_offset); }
  void event(const std::string& text, hal::UtcTime utc) override { writer_.write_event(text, utc); }
  void commit_if_due() override { writer_.bag().commit_if_due(); }
  void give_up_last() noexcept override { writer_.bag().give_up_last_transaction(); }
  void close() override { writer_.close(); }
  std::uint64_t bytes() const override { return writer_.bag().bytes(); }
  const std::filesystem::path& folder() const override { return writer_.bag().folder(); }

 private:
  mutable Rosbag2Writer writer_;
};

}  // namespace

std::unique_ptr<RecordingSink> make_recording_sink(const std::filesystem::path& path, const std::vector<hal::CameraDescription>& cameras,
                                                   const std::vector<hal::DepthFrame>& background, BagContents contents, const hal::SealFiles& seal) {
  if (seal) return make_sealed_sink(path, cameras, background, contents, seal);
  return std::make_unique<BagSink>(path, cameras, background, contents);
}

}  // namespace booth::drivers
