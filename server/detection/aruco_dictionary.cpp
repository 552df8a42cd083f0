#include "detection/aruco_dictionary.hpp"

// OpenCV 4.7 moved the dictionaries into another module and gives them by value.
#if __has_include(<opencv2/objdetect/aruco_dictionary.hpp>)
#include <opencv2/objdetect/aruco_dictionary.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

#include "base/assert.hpp"

namespace fiducap {

namespace {

using OpenCvDictionary = cv::aruco::Dictionary;

[[maybe_unused]] const OpenCvDictionary& value_of(const OpenCvDictionary& dictionary) {
  return dictionary;
}
[[maybe_unused]] const OpenCvDictionary& value_of(const cv::Ptr<OpenCvDictionary>& dictionary) {
  return *dictionary;
}

}  // namespace

ArucoDictionary aruco_dictionary(int number) {
  const auto predefined = cv::aruco::getPredefinedDictionary(number);
  const OpenCvDictionary& dictionary = value_of(predefined);
  ArucoDictionary out;
  out.side = dictionary.markerSize;
  FIDUCAP_ASSERT(out.side * out.side < 64);
  for (int id = 0; id < dictionary.bytesList.rows; ++id) {
    const cv::Mat bits =
        OpenCvDictionary::getBitsFromByteList(dictionary.bytesList.row(id), out.side);
    std::uint64_t code = 0;
    for (int row = 0; row < out.side; ++row) {
      for (int column = 0; column < out.side; ++column)
        code = code << 1 | (bits.at<std::uint8_t>(row, column) != 0 ? 1 : 0);
    }
    out.codes.push_back(code);
  }
  return out;
}

}  // namespace fiducap
