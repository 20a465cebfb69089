// The booth's own topics, read and commanded with Fast DDS; types made from the booth's IDL as it is.
#include <chrono>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <thread>

#include "boothPubSubTypes.h"  // made from daemon/dds/idl/booth.idl by fastddsgen
#include "tests/daemon/dds/ros2/fastdds_ear.hpp"

namespace booth::tests::fastdds {
namespace {

using namespace booth::msg;

Json json(const Joint& j) { return {{"position", j.position()}, {"orientation", j.orientation()}, {"covariance", j.covariance()}, {"seen", j.seen()}}; }
Json json(const Skeleton& s) {
  Json joints = Json::array();
  for (const Joint& j : s.joints()) joints.push_back(json(j));
  return {{"booth", s.booth().to_string()},
          {"version", s.version()},
          {"serial_number", s.serial_number()},
          {"frame", s.frame()},
          {"capture_utc_ns", s.capture_utc_ns()},
          {"capture_monotonic_ns", s.capture_monotonic_ns()},
          {"publish_utc_ns", s.publish_utc_ns()},
          {"publish_monotonic_ns", s.publish_monotonic_ns()},
          {"state", static_cast<int>(s.state())},
          {"person", static_cast<int>(s.person())},
          {"sex", static_cast<int>(s.sex())},
          {"q", s.q()},
          {"beta", s.beta()},
          {"joints", joints},
          {"residual", s.residual()},
          {"coverage", s.coverage()},
          {"cameras", s.cameras()},
          {"others", s.others()},
          {"groups_dropped", s.groups_dropped()}};
}
Json json(const Body& b) {
  Json measurements = Json::array();
  for (const auto& m : b.measurements())
    measurements.push_back({{"name", m.name().to_string()}, {"unit", m.unit().to_string()}, {"value", m.value()}, {"deviation", m.deviation()}});
  return {{"booth", b.booth().to_string()},
          {"version", b.version()},
          {"session", b.session().to_string()},
          {"utc_ns", b.utc_ns()},
          {"sex", static_cast<int>(b.sex())},
          {"model_version", b.model_version().to_string()},
          {"beta", b.beta()},
          {"bone_lengths", b.bone_lengths()},
          {"measurements", measurements}};
}
Json json(const Status& s) {
  Json faults = Json::array(), cameras = Json::array();
  for (const auto& f : s.faults()) faults.push_back({{"source", f.source().to_string()}, {"text", f.text().to_string()}});
  for (const auto& c : s.cameras())
    cameras.push_back({{"name", c.name().to_string()},
                       {"state", c.state().to_string()},
                       {"fps", c.fps()},
                       {"delivered", c.delivered()},
                       {"dropped", c.dropped()},
                       {"restarts", c.restarts()}});
  return {{"booth", s.booth().to_string()},
          {"version", s.version()},
          {"software", s.software().to_string()},
          {"utc_ns", s.utc_ns()},
          {"monotonic_ns", s.monotonic_ns()},
          {"state", static_cast<int>(s.state())},
          {"degraded", s.degraded()},
          {"paused", s.paused()},
          {"emergency_latched", s.emergency_latched()},
          {"session", s.session().to_string()},
          {"alarm", s.alarm().to_string()},
          {"faults", faults},
          {"cameras", cameras},
          {"frames", s.frames()},
          {"groups_dropped", s.groups_dropped()},
          {"fps", s.fps()},
          {"latency_p50_ms", s.latency_p50_ms()},
          {"latency_p99_ms", s.latency_p99_ms()},
          {"residual", s.residual()},
          {"calibration_age_s", s.calibration_age_s()},
          {"calibration_residual", s.calibration_residual()},
          {"disk_free_bytes", s.disk_free_bytes()},
          {"disk_total_bytes", s.disk_total_bytes()}};
}
Json json(const Event& e) {
  return {{"booth", e.booth().to_string()}, {"version", e.version()},           {"serial_number", e.serial_number()}, {"utc_ns", e.utc_ns()},
          {"kind", e.kind().to_string()},   {"source", e.source().to_string()}, {"text", e.text().to_string()}};
}
Json json(const Reply& r) {
  return {{"booth", r.booth().to_string()}, {"version", r.version()},   {"sender", r.sender().to_string()},     {"id", r.id()},
          {"accepted", r.accepted()},       {"repeated", r.repeated()}, {"state", static_cast<int>(r.state())}, {"text", r.text().to_string()}};
}

/// Says start again and again, as a patient client does: the same command, so that the booth carries it out once.
void command(efd::DomainParticipant& participant, efd::Publisher& publisher, const std::string& booth) {
  efd::TypeSupport support(new booth::msg::CommandPubSubType);
  support.register_type(&participant);
  efd::Topic* topic = participant.create_topic("booth/command", support.get_type_name(), efd::TOPIC_QOS_DEFAULT);
  efd::DataWriter* writer = publisher.create_datawriter(topic, efd::DATAWRITER_QOS_DEFAULT);
  std::thread([writer, booth] {
    booth::msg::Command c;
    c.booth(booth);
    c.version(booth::msg::VERSION);
    c.sender("another vendor");
    c.id(77);
    c.kind(booth::msg::COMMAND_START);
    c.utc_ns(std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch()).count());
    while (true) {
      writer->write(&c);
      std::this_thread::sleep_for(std::chrono::seconds(1));
    }
  }).detach();
}

}  // namespace

void hear_booth(efd::DomainParticipant& participant, const std::string& booth) {
  efd::SubscriberQos hears = efd::SUBSCRIBER_QOS_DEFAULT;
  hears.partition().push_back(booth.c_str());
  efd::Subscriber& subscriber = *participant.create_subscriber(hears);
  static const Ear<booth::msg::Skeleton, booth::msg::SkeletonPubSubType> skeleton(participant, subscriber, "booth/skeleton", Service::best_effort, json);
  static const Ear<booth::msg::Body, booth::msg::BodyPubSubType> body(participant, subscriber, "booth/body", Service::latched, json);
  static const Ear<booth::msg::Status, booth::msg::StatusPubSubType> status(participant, subscriber, "booth/status", Service::latched, json);
  static const Ear<booth::msg::Event, booth::msg::EventPubSubType> event(participant, subscriber, "booth/event", Service::reliable, json);
  static const Ear<booth::msg::Reply, booth::msg::ReplyPubSubType> reply(participant, subscriber, "booth/reply", Service::reliable, json);
  efd::PublisherQos says = efd::PUBLISHER_QOS_DEFAULT;
  says.partition().push_back(booth.c_str());
  command(participant, *participant.create_publisher(says), booth);
}

}  // namespace booth::tests::fastdds
