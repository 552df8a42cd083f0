// Reads PoseStamped by Cyclone DDS with its default settings: cyclone_peer DOMAIN SECONDS TOPIC
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include <dds/dds.h>

#include <fiducap_dds/ros_geometry.h>

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: cyclone_peer DOMAIN SECONDS TOPIC\n");
    return 2;
  }
  ::unsetenv("CYCLONEDDS_URI");
  const auto participant =
      dds_create_participant(static_cast<dds_domainid_t>(std::atoi(argv[1])), nullptr, nullptr);
  const auto topic = dds_create_topic(participant, &geometry_msgs_msg_dds__PoseStamped__desc,
                                      argv[3], nullptr, nullptr);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 100);
  const auto reader = dds_create_reader(participant, topic, qos, nullptr);
  dds_delete_qos(qos);
  if (reader < 0) {
    std::fprintf(stderr, "no reader: %s\n", dds_strretcode(reader));
    return 1;
  }
  long count = 0;
  const dds_time_t end = dds_time() + DDS_SECS(std::atoi(argv[2]));
  while (dds_time() < end) {
    std::array<void*, 100> samples{};  // on loan
    std::array<dds_sample_info_t, 100> about{};
    const auto taken = dds_take(reader, samples.data(), about.data(), samples.size(),
                                static_cast<std::uint32_t>(samples.size()));
    for (int i = 0; i < taken; ++i) count += about[static_cast<std::size_t>(i)].valid_data ? 1 : 0;
    if (taken > 0) dds_return_loan(reader, samples.data(), taken);
    dds_sleepfor(DDS_MSECS(5));
  }
  std::printf("%s count=%ld last: \n", argv[3], count);
  dds_delete(participant);
  return 0;
}
