#include "peer.hpp"

#include <cstdio>
#include <cstdlib>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>

// Fast DDS 2.9 (StatisticsReaderImpl) deletes an object as its smaller base. Read by
// AddressSanitizer.
extern "C" const char* __asan_default_options() { return "new_delete_type_mismatch=0"; }

namespace fast_dds_peer {
namespace {

using eprosima::fastrtps::rtps::IPLocator;

/// UDP on one address only; without multicast, discovery uses the address of the peer.
/// @param own_address  `-`: the vendor's defaults, all transports on all interfaces
dds::DomainParticipantQos qos_for(const std::string& own_address, const std::string& peer) {
  dds::DomainParticipantQos qos;
  qos.name("fast_dds_peer");
  if (own_address == "-") return qos;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back(own_address);
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.leaseDuration_announcementperiod = {0, 500'000'000};
  if (peer != "-") {
    eprosima::fastrtps::rtps::Locator_t at;
    at.kind = LOCATOR_KIND_UDPv4;
    at.port = 0;  // the well-known ones of the domain
    IPLocator::setIPv4(at, peer);
    qos.wire_protocol().builtin.initialPeersList.push_back(at);
    // Announced, so that no multicast group is needed to answer.
    eprosima::fastrtps::rtps::Locator_t own;
    own.kind = LOCATOR_KIND_UDPv4;
    own.port = 0;
    IPLocator::setIPv4(own, own_address);
    qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(own);
  }
  return qos;
}

std::vector<WantedTopic> topics_from(int argc, char** argv, int first) {
  std::vector<WantedTopic> topics;
  for (int i = first; i < argc; ++i) {
    const std::string text = argv[i];
    const auto one = text.find(':');
    const auto two = text.find(':', one + 1);
    topics.push_back({text.substr(0, one),
                      text.substr(one + 1, two == std::string::npos ? two : two - one - 1),
                      two == std::string::npos ? "" : text.substr(two + 1)});
  }
  return topics;
}

int run(int argc, char** argv) {
  if (argc < 6) {
    std::fprintf(stderr,
                 "usage: fast_dds_peer read|write DOMAIN OWN_ADDRESS|- PEER|- SECONDS "
                 "TYPE:TOPIC[:FLAGS]...|CAMERA\n");
    return 2;
  }
  const auto qos = qos_for(argv[3], argv[4]);
  auto* factory = dds::DomainParticipantFactory::get_instance();
  auto* participant =
      factory->create_participant(static_cast<std::uint32_t>(std::atoi(argv[2])), qos);
  if (participant == nullptr) {
    std::fprintf(stderr, "no participant\n");
    return 1;
  }
  const Seconds duration(std::atof(argv[5]));
  const bool writes = std::string(argv[1]) == "write";
  const int code = writes ? write_sensors(*participant, argc > 6 ? argv[6] : "/cam0", duration)
                          : read_topics(*participant, topics_from(argc, argv, 6), duration);
  participant->delete_contained_entities();
  factory->delete_participant(participant);
  return code;
}

}  // namespace
}  // namespace fast_dds_peer

int main(int argc, char** argv) { return fast_dds_peer::run(argc, argv); }
