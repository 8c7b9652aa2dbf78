// Fast DDS on both ends: a topic whose samples are messages, found by unicast over both modems.
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <cstring>
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
#include <memory>
#include <mutex>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "lab/transports/ends.h"
#include "lab/transports/sockets.h"
#include "lab/transports/timetable.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

using namespace std::chrono_literals;
namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

constexpr Duration kDdsPatience = 30s;
constexpr Duration kDdsLook = 10ms;
// Both ends look that often whether a signal has come.
constexpr Duration kLookForSignals = 100ms;

constexpr const char* kTopic = "messages";
// Where the first participant of domain 0 of a host is found by the defaults of RTPS: 7400 and 10.
constexpr std::uint32_t kDiscoveryPort = 7410;
// In front of every sample: how it is encoded.
constexpr std::uint32_t kEncapsulation = 4;

// What the mode "tuned" changes: datagrams that no network has to cut, where the default is 64 KiB,
// and buffers that hold several messages. It stays best effort: a reliable writer announces with
// every datagram what it has sent, and a reader asks at once for all that still waits in the queue
// of the slower link; repairs then took 7 to 40 times the bytes of the messages.
constexpr const char* kTuned = "tuned";
constexpr std::uint32_t kTunedDatagram = 1400;
constexpr std::uint32_t kTunedBuffers = kBufferBytes;

// A message as a type of DDS: its bytes as they are, without a key.
class MessageType : public dds::TopicDataType {
 public:
  MessageType() {
    setName("Message");
    m_typeSize = static_cast<std::uint32_t>(kMaxMessageBytes) + kEncapsulation;
  }
  bool serialize(void* data, SerializedPayload_t* payload) override {
    const Bytes& bytes = *static_cast<Bytes*>(data);
    payload->encapsulation = CDR_LE;
    payload->length = size_of(bytes);
    if (payload->max_size < payload->length) return false;
    constexpr std::array<std::uint8_t, kEncapsulation> kPlainCdr{0, 1, 0, 0};
    std::memcpy(payload->data, kPlainCdr.data(), kEncapsulation);
    std::memcpy(payload->data + kEncapsulation, bytes.data(), bytes.size());
    return true;
  }
  bool deserialize(SerializedPayload_t* payload, void* data) override {
    if (payload->length < kEncapsulation) return false;
    Bytes& bytes = *static_cast<Bytes*>(data);
    bytes.resize(payload->length - kEncapsulation);
    std::memcpy(bytes.data(), payload->data + kEncapsulation, bytes.size());
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return size_of(*static_cast<Bytes*>(data)); };
  }
  void* createData() override { return std::make_unique<Bytes>().release(); }
  void deleteData(void* data) override {
    const std::unique_ptr<Bytes> ended(static_cast<Bytes*>(data));
  }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }

 private:
  static std::uint32_t size_of(const Bytes& bytes) {
    return static_cast<std::uint32_t>(bytes.size()) + kEncapsulation;
  }
};

template <class T>
T* made(T* object, const char* what) {
  if (object == nullptr) throw Failure(kFailed, std::string("Fast DDS makes no ") + what);
  return object;
}

// A participant with the one topic; everything that was made with it ends with it.
class Participant {
 public:
  explicit Participant(const Order& order) {
    dds::DomainParticipantQos qos;
    qos.name("interneuron");
    // By UDP alone: shared memory would carry samples past the links of the testbed.
    qos.transport().use_builtin_transports = false;
    const auto udp = std::make_shared<rtps::UDPv4TransportDescriptor>();
    if (order.transport.mode == kTuned) {
      udp->maxMessageSize = kTunedDatagram;
      udp->sendBufferSize = kTunedBuffers;
      udp->receiveBufferSize = kTunedBuffers;
    }
    qos.transport().user_transports.push_back(udp);
    // By unicast, since no multicast crosses the core of a cellular network.
    for (const Modem& modem : order.modems) {
      Locator_t locator;
      locator.kind = LOCATOR_KIND_UDPv4;
      IPLocator::setIPv4(locator, modem.road_address);
      IPLocator::setPhysicalPort(locator, static_cast<std::uint16_t>(kDiscoveryPort));
      qos.wire_protocol().builtin.initialPeersList.push_back(locator);
    }
    participant_ = made(dds::DomainParticipantFactory::get_instance()->create_participant(0, qos),
                        "participant");
    const dds::TypeSupport type(new MessageType);
    type.register_type(participant_);
    topic_ = made(participant_->create_topic(kTopic, type.get_type_name(), dds::TOPIC_QOS_DEFAULT),
                  "topic");
  }
  ~Participant() {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  dds::DataWriter* writer() {
    dds::DataWriterQos qos;
    // A message of several datagrams is sent by a thread of Fast DDS.
    qos.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
    // The default of a writer alone is reliable; that of a reader is not, and the pair is what both
    // can do. No bytes are spent on it so.
    qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
    set(qos);
    dds::Publisher* publisher =
        made(participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT), "publisher");
    return made(publisher->create_datawriter(topic_, qos), "writer");
  }
  dds::DataReader* reader(dds::DataReaderListener* listener) {
    dds::DataReaderQos qos;
    set(qos);
    dds::Subscriber* subscriber =
        made(participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT), "subscriber");
    return made(subscriber->create_datareader(topic_, qos, listener), "reader");
  }

 private:
  // What both ends have alike.
  template <class Qos>
  static void set(Qos& qos) {
    qos.data_sharing().off();
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  }

  // Owned by Fast DDS.
  dds::DomainParticipant* participant_ = nullptr;
  dds::Topic* topic_ = nullptr;
};

void await_reader(dds::DataWriter& writer) {
  const TimePoint patience = io::now() + kDdsPatience;
  for (;;) {
    dds::PublicationMatchedStatus status;
    writer.get_publication_matched_status(status);
    if (status.current_count > 0) return;
    if (io::now() > patience) throw Failure(kFailed, "Fast DDS does not find the roadside unit");
    SignalWatch::sleep(kDdsLook);
  }
}

// Notes what comes, on threads of Fast DDS.
class Listener : public dds::DataReaderListener {
 public:
  explicit Listener(Reception& reception) : reception_(reception) {}
  void on_data_available(dds::DataReader* reader) override {
    const std::lock_guard lock(mutex_);
    dds::SampleInfo info;
    while (reader->take_next_sample(&bytes_, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      if (const auto head = read_head(bytes_)) reception_.arrived(*head, 0, io::now());
    }
  }

 private:
  std::mutex mutex_;
  Bytes bytes_;
  Reception& reception_;
};

}  // namespace

std::optional<std::string> lacks_fastdds() { return std::nullopt; }

VehiclesRecord send_fastdds(const Order& order, const Begin& ready) {
  const Traffic& traffic = order.traffic;
  Participant participant(order);
  dds::DataWriter& writer = *participant.writer();
  await_reader(writer);
  const io::PreciseTimers precise;
  VehiclesRecord record;
  record.begun.resize(traffic.vehicles());
  const TimePoint begin = ready();
  for (const Due& due : timetable(traffic)) {
    SignalWatch::sleep(begin + due.at - io::now());
    std::vector<TimePoint>& begun = record.begun[due.vehicle];
    Bytes message =
        message_of(static_cast<std::uint32_t>(due.vehicle),
                   static_cast<std::uint32_t>(begun.size()), traffic.variant_bytes.front());
    begun.push_back(io::now());
    writer.write(&message);
  }
  SignalWatch::sleep(begin + traffic.length + traffic.deadline - io::now());
  return record;
}

void receive_fastdds(const Order& order, const Ready& ready, Reception& reception) {
  Listener listener(reception);
  Participant participant(order);
  participant.reader(&listener);
  ready();
  while (SignalWatch::last() == 0) wait_for({}, io::now() + kLookForSignals);
}

}  // namespace interneuron::transports
