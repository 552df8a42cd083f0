#include <cmath>
#include <cstdio>
#include <thread>

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include "peer.hpp"
#include "ros_sensorsPubSubTypes.h"

namespace fast_dds_peer {
namespace {

namespace sensor = sensor_msgs::msg::dds_;

constexpr std::uint32_t kWidth = 640;
constexpr std::uint32_t kHeight = 480;
constexpr int kImuPerImage = 10;
constexpr std::chrono::milliseconds kImuPeriod{5};

template <typename Support>
dds::DataWriter* make_writer(dds::DomainParticipant& participant, dds::Publisher& publisher,
                             const std::string& name, bool reliable) {
  dds::TypeSupport type(new Support());
  type->auto_fill_type_information(false);
  type->auto_fill_type_object(false);
  type.register_type(&participant);
  auto* topic = participant.create_topic(name, type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
  dds::DataWriterQos qos;
  qos.reliability().kind =
      reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.history().depth = 5;
  qos.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
  return publisher.create_datawriter(topic, qos);
}

template <typename Message>
void stamp(Message& message, const std::string& frame) {
  const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                      std::chrono::system_clock::now().time_since_epoch())
                      .count();
  message.header().stamp().sec(static_cast<std::int32_t>(ns / 1'000'000'000));
  message.header().stamp().nanosec(static_cast<std::uint32_t>(ns % 1'000'000'000));
  message.header().frame_id(frame);
}

sensor::CameraInfo_ camera_info() {
  sensor::CameraInfo_ info;
  info.width(kWidth);
  info.height(kHeight);
  info.distortion_model("plumb_bob");
  info.d({-0.28, 0.07, 0.0002, 0.00002, 0.0});
  info.k({458.0, 0, 320.5, 0, 457.0, 240.5, 0, 0, 1});
  info.r({1, 0, 0, 0, 1, 0, 0, 0, 1});
  info.p({458.0, 0, 320.5, 0, 0, 457.0, 240.5, 0, 0, 0, 1, 0});
  return info;
}

}  // namespace

int write_sensors(dds::DomainParticipant& participant, const std::string& folder,
                  Seconds duration) {
  auto* publisher = participant.create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  auto* images = make_writer<sensor::Image_PubSubType>(participant, *publisher,
                                                       "rt" + folder + "/image_raw", true);
  auto* infos = make_writer<sensor::CameraInfo_PubSubType>(participant, *publisher,
                                                           "rt" + folder + "/camera_info", true);
  auto* imus = make_writer<sensor::Imu_PubSubType>(participant, *publisher, "rt/imu/data", false);
  sensor::Image_ image;
  image.width(kWidth);
  image.height(kHeight);
  image.encoding("mono8");
  image.step(kWidth);
  image.data().resize(kWidth * kHeight);
  sensor::CameraInfo_ info = camera_info();
  sensor::Imu_ imu;
  imu.linear_acceleration().z(9.81);
  const auto end = std::chrono::steady_clock::now() + duration;
  auto due = std::chrono::steady_clock::now();
  int written = 0;
  for (int tick = 0; std::chrono::steady_clock::now() < end; ++tick, due += kImuPeriod) {
    std::this_thread::sleep_until(due);
    stamp(imu, "imu");
    imu.angular_velocity().z(0.001 * tick);
    imus->write(&imu);
    if (tick % kImuPerImage != 0) continue;
    std::fill(image.data().begin(), image.data().end(), static_cast<std::uint8_t>(written));
    stamp(image, "cam0");
    stamp(info, "cam0");
    infos->write(&info);
    images->write(&image);
    ++written;
  }
  std::printf("images=%d\n", written);
  return 0;
}

}  // namespace fast_dds_peer
