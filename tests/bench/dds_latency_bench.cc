// How long a relative pose takes from Publisher::Write in one process to the handler in another,
// against bare Fast DDS with as many bytes: no keys, no checks, no conversion, one memcpy on either
// side. And how long a whole frame takes on the camera box's own path: from the grabber's hand
// (copy, mailbox, solver thread, find, assign, solve, bound, queue, DDS) to the handler in the
// other process. All take turns in the same run, over UDP on loopback; the two processes share the
// steady clock.
//
//   dds_latency_bench [samples of each]
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include "devices/sim/camera_view.h"
#include "devices/sim/world.h"
#include "idl/cpp/fastdds_setup.h"
#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "idl/cpp/wire_type.h"
#include "pose/app/box_messages.h"
#include "pose/app/frame_mailbox.h"
#include "pose/app/queued_sink.h"
#include "pose/frame/frame_solver.h"
#include "pose/rig/rig_file.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/samples.h"

namespace tbm::dds::test {
namespace {

namespace fdds = eprosima::fastdds::dds;

constexpr int kDomain = 190;
constexpr double kWantedRatio = 1.5;
constexpr std::string_view kFramePath = "frame path";

std::int64_t SteadyNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

using Octets = std::vector<char>;

// So many bytes in and out, nothing else.
class OctetsType final : public fdds::TopicDataType {
 public:
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
  explicit OctetsType(std::size_t size) : size_(size) {
    setName("bench::Octets");
    m_typeSize = static_cast<std::uint32_t>(size + 4);
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, Payload* payload) override {
    payload->encapsulation = CDR_LE;
    const char header[4] = {0, 1, 0, 0};
    std::memcpy(payload->data, header, 4);
    std::memcpy(payload->data + 4, static_cast<Octets*>(data)->data(), size_);
    payload->length = static_cast<std::uint32_t>(size_ + 4);
    return true;
  }
  bool deserialize(Payload* payload, void* data) override {
    std::memcpy(static_cast<Octets*>(data)->data(), payload->data + 4, size_);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [this] { return m_typeSize; };
  }
  void* createData() override { return new Octets(size_); }
  void deleteData(void* data) override { delete static_cast<Octets*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }

 private:
  std::size_t size_;
};

// One process' end of the bare topic.
class Bare {
 public:
  explicit Bare(std::size_t size) {
    ParticipantConfig config;
    config.name = "bare";
    participant_ = fdds::DomainParticipantFactory::get_instance()->create_participant(
        kDomain, ParticipantQosFor(config, {"127.0.0.1"}));
    fdds::TypeSupport type(new OctetsType(size));
    type.register_type(participant_);
    topic_ = participant_->create_topic("bench/octets", type.get_type_name(), fdds::TopicQos{});
  }
  ~Bare() {
    participant_->delete_contained_entities();
    fdds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  fdds::DataWriter* Writer() {
    fdds::DataWriterQos qos;
    qos.history().depth = 5;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
    qos.data_sharing().off();
    return participant_->create_publisher(fdds::PublisherQos{})->create_datawriter(topic_, qos);
  }
  fdds::DataReader* Reader(fdds::DataReaderListener* listener) {
    fdds::DataReaderQos qos;
    qos.reliability().kind = fdds::RELIABLE_RELIABILITY_QOS;
    qos.history().depth = 5;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
    qos.data_sharing().off();
    return participant_->create_subscriber(fdds::SubscriberQos{})
        ->create_datareader(topic_, qos, listener);
  }

 private:
  fdds::DomainParticipant* participant_ = nullptr;
  fdds::Topic* topic_ = nullptr;
};

struct BareListener final : fdds::DataReaderListener {
  explicit BareListener(std::size_t size) : octets(size) {}
  void on_data_available(fdds::DataReader* reader) override {
    fdds::SampleInfo info;
    while (reader->take_next_sample(&octets, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      const std::int64_t now = SteadyNs();
      std::int64_t sent = 0;
      std::memcpy(&sent, octets.data(), sizeof sent);
      latencies_ns.push_back(now - sent);
    }
  }
  Octets octets;
  std::vector<std::int64_t> latencies_ns;
};

std::size_t WireSize() {
  v1::RelativePose wire;
  ToWire(FullRelativePose(), wire);
  return v1::RelativePose::getCdrSerializedSize(wire);
}

// The reading process: until `samples` of both have come or nothing more comes. Latencies go to the
// pipe.
int Receive(int samples, int out) {
  BareListener listener(WireSize());
  listener.latencies_ns.reserve(static_cast<std::size_t>(samples) + 1000);
  std::vector<std::int64_t> typed;
  std::vector<std::int64_t> frames;
  typed.reserve(static_cast<std::size_t>(samples) + 1000);
  frames.reserve(static_cast<std::size_t>(samples) + 1000);
  Participant participant(OnLoopback(kDomain, "receiver"));
  Bare bare(WireSize());
  bare.Reader(&listener);
  const Subscriber<RelativePose> subscriber(
      participant, [&](const RelativePose& pose, const SampleFacts&) {
        const std::int64_t taken = SteadyNs() - static_cast<std::int64_t>(pose.sample_number);
        (pose.machine_id.view() == kFramePath ? frames : typed).push_back(taken);
      });
  const auto until =
      std::chrono::steady_clock::now() + std::chrono::milliseconds(samples * 8 + 8000);
  const auto wanted = static_cast<std::size_t>(samples);
  while (
      (typed.size() < wanted || frames.size() < wanted || listener.latencies_ns.size() < wanted) &&
      std::chrono::steady_clock::now() < until) {
    std::this_thread::sleep_for(20ms);
  }
  for (const auto* latencies : {&listener.latencies_ns, &typed, &frames}) {
    const std::size_t count = latencies->size();
    if (write(out, &count, sizeof count) < 0) return 1;
    if (write(out, latencies->data(), count * sizeof(std::int64_t)) < 0) return 1;
  }
  return 0;
}

// The box's frame path with one rendered frame, over and over; sample_number carries the steady
// time at which the grabber had the frame.
class FramePath final : public MessageSink {
 public:
  explicit FramePath(Publisher<RelativePose>& publisher)
      : publisher_(publisher),
        rig_(LoadRigFile(TBM_SOURCE_DIR "/pose/app/example/rig.yaml").value().rig),
        solver_(rig_),
        queue_(*this) {
    const Timestamp begin{1'790'000'000'000'000'000};
    const auto world =
        std::make_shared<const sim::World>(rig_, sim::Motion{}, sim::Faults{}, begin);
    sim::CameraView view(world, {});
    pixels_.resize(view.size_bytes());
    view.Render(begin, 5000.0, pixels_.data());
    frame_.image = {pixels_.data(), view.width_px(), view.height_px(), view.width_px(), 1, 255};
    tilts_[0] = world->TiltReading(sim::TiltSensor::kTarget, begin);
    tilts_[1] = world->TiltReading(sim::TiltSensor::kCamera, begin);
    computed_ns_.reserve(100'000);
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (const OwnedFrame* frame = mailbox_.Take(100ms)) Solve(frame->frame);
      }
    });
  }

  void FrameIn() {
    frame_.frame_number = static_cast<std::uint64_t>(SteadyNs());
    frame_.sensed_at.ns += 100'000'000;
    const std::int64_t began = SteadyNs();
    mailbox_.Put(frame_);
    copied_ns_ = SteadyNs() - began;
  }
  // Of each frame: copy, find, assign, solve, bound, message. After the thread has ended.
  std::vector<std::int64_t> End() {
    thread_ = {};
    return computed_ns_;
  }

  void Publish(const RelativePose& message) override { publisher_.Write(message); }
  void Publish(const FrameFeatures&) override {}
  void Publish(const TiltReading&) override {}
  void Publish(const DeviceHealth&) override {}
  void Publish(const Event&) override {}

 private:
  void Solve(const Frame& frame) {
    const std::int64_t began = SteadyNs();
    solver_.AddTilt({frame.sensed_at, TiltSensor::kTarget, tilts_[0]});
    solver_.AddTilt({frame.sensed_at, TiltSensor::kCamera, tilts_[1]});
    const FrameResult& result = solver_.Solve({frame.sensed_at, frame.image, PoseReason::kNone});
    RelativePose pose;
    FillRelativePose(kFramePath, "hash", rig_, result, &pose);
    pose.sample_number = frame.frame_number;
    pose.published_at = frame.sensed_at;
    queue_.Publish(pose);
    computed_ns_.push_back(SteadyNs() - began + copied_ns_);
  }

  Publisher<RelativePose>& publisher_;
  Rig rig_;
  std::vector<std::uint8_t> pixels_;
  Frame frame_;
  std::array<Inclination, 2> tilts_;
  FrameSolver solver_;
  FrameMailbox mailbox_;
  QueuedSink queue_;
  std::vector<std::int64_t> computed_ns_;
  std::atomic<std::int64_t> copied_ns_{0};  // of the latest frame
  std::jthread thread_;
};

// Takes turns until `samples` of each are out. Gives what each frame's computing took.
std::vector<std::int64_t> Send(int samples) {
  Participant participant(OnLoopback(kDomain, "sender"));
  Publisher<RelativePose> publisher(participant);
  Bare bare(WireSize());
  fdds::DataWriter* writer = bare.Writer();
  fdds::PublicationMatchedStatus matched;
  Eventually([&] {
    writer->get_publication_matched_status(matched);
    return publisher.matched_readers() == 1 && matched.current_count == 1;
  });
  std::this_thread::sleep_for(300ms);
  FramePath frames(publisher);
  RelativePose pose = FullRelativePose();
  Octets octets(WireSize());
  for (int i = 0; i < samples; ++i) {
    const std::int64_t bare_at = SteadyNs();
    std::memcpy(octets.data(), &bare_at, sizeof bare_at);
    writer->write(&octets);
    std::this_thread::sleep_for(1500us);
    pose.sample_number = static_cast<std::uint64_t>(SteadyNs());
    publisher.Write(pose);
    std::this_thread::sleep_for(1500us);
    frames.FrameIn();
    std::this_thread::sleep_for(3000us);
  }
  std::this_thread::sleep_for(200ms);
  return frames.End();
}

std::vector<std::int64_t> FromPipe(int in) {
  std::size_t count = 0;
  if (read(in, &count, sizeof count) != sizeof count) return {};
  std::vector<std::int64_t> latencies(count);
  char* at = reinterpret_cast<char*>(latencies.data());
  std::size_t missing = count * sizeof(std::int64_t);
  while (missing > 0) {
    const ssize_t got = read(in, at, missing);
    if (got <= 0) return {};
    at += got;
    missing -= static_cast<std::size_t>(got);
  }
  return latencies;
}

double Percentile_us(std::vector<std::int64_t> latencies_ns, double share) {
  const auto at = static_cast<std::size_t>(share * static_cast<double>(latencies_ns.size() - 1));
  std::nth_element(latencies_ns.begin(),
                   latencies_ns.begin() + static_cast<std::ptrdiff_t>(at),
                   latencies_ns.end());
  return static_cast<double>(latencies_ns[at]) * 1e-3;
}

// What conversion, checks, key and CDR take on both sides together, warm.
double Compute_us() {
  const RelativePose pose = FullRelativePose();
  WireSample<v1::RelativePose> out;
  WireSample<v1::RelativePose> in;
  WireType<RelativePose> type;
  WireType<RelativePose>::Payload payload(type.m_typeSize);
  WireType<RelativePose>::Handle key;
  RelativePose back;
  constexpr int kRounds = 20000;
  const std::int64_t began = SteadyNs();
  for (int i = 0; i < kRounds; ++i) {
    ToWire(pose, out.value);
    if (Check(out.value) != BoundaryFault::kNone) return kNaN;
    type.getKey(&out, &key, false);
    type.serialize(&out, &payload);
    type.deserialize(&payload, &in);
    if (Check(in.value) != BoundaryFault::kNone) return kNaN;
    FromWire(in.value, back);
  }
  return static_cast<double>(SteadyNs() - began) * 1e-3 / kRounds;
}

int Main(int samples) {
  const double compute_us = Compute_us();
  sched_param priority{};
  priority.sched_priority = 10;
  const bool is_real_time = sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
  int ends[2];
  if (pipe(ends) != 0) return 1;
  const pid_t receiver = fork();  // before anything of DDS exists
  if (receiver == 0) {
    close(ends[0]);
    std::_Exit(Receive(samples, ends[1]));
  }
  close(ends[1]);
  const std::vector<std::int64_t> computed = Send(samples);
  const std::vector<std::int64_t> bare = FromPipe(ends[0]);
  const std::vector<std::int64_t> typed = FromPipe(ends[0]);
  const std::vector<std::int64_t> frames = FromPipe(ends[0]);
  waitpid(receiver, nullptr, 0);
  if (bare.size() < 50 || typed.size() < 50 || frames.size() < 50) {
    std::printf("dds_latency: too few samples arrived (%zu bare, %zu typed, %zu frames)\n",
                bare.size(),
                typed.size(),
                frames.size());
    return 1;
  }
  const double bare_p99_us = Percentile_us(bare, 0.99);
  const double typed_p99_us = Percentile_us(typed, 0.99);
  std::printf("%zu bytes, one way, another process, loopback UDP%s\n",
              WireSize(),
              is_real_time ? ", real-time priority" : "");
  std::printf("bare Fast DDS   p50 %7.1f us  p99 %7.1f us  %zu of %d\n",
              Percentile_us(bare, 0.5),
              bare_p99_us,
              bare.size(),
              samples);
  std::printf("our publisher   p50 %7.1f us  p99 %7.1f us  %zu of %d\n",
              Percentile_us(typed, 0.5),
              typed_p99_us,
              typed.size(),
              samples);
  std::printf("conversion, checks, key and CDR on both sides: %.1f us\n", compute_us);
  std::printf("p50 ratio %.2f\n", Percentile_us(typed, 0.5) / Percentile_us(bare, 0.5));
  std::printf(
      "bench dds_latency: %.2fx p99 of a bare Fast DDS sample of the same size (wanted %.1f)\n",
      typed_p99_us / bare_p99_us,
      kWantedRatio);
  const double frame_p99_us = Percentile_us(frames, 0.99);
  const double computed_p99_us = Percentile_us(computed, 0.99);
  std::printf(
      "a whole frame   p50 %7.1f us  p99 %7.1f us  %zu of %d; of it computing p50 %.1f us p99 %.1f "
      "us\n",
      Percentile_us(frames, 0.5),
      frame_p99_us,
      frames.size(),
      samples,
      Percentile_us(computed, 0.5),
      computed_p99_us);
  std::printf("bench frame_latency: %.2fx p99 of a bare sample plus the computing (wanted %.1f)\n",
              frame_p99_us / (bare_p99_us + computed_p99_us),
              kWantedRatio);
  return 0;
}

}  // namespace
}  // namespace tbm::dds::test

int main(int argc, char** argv) {
  return tbm::dds::test::Main(argc > 1 ? std::max(100, std::atoi(argv[1])) : 2000);
}
