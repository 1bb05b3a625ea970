//! Messages survive the wire, in place or not, and no bytes break a reader.

use proptest::prelude::*;

use super::{builtin_interfaces::Time, sensor_msgs::*, *};

/// The pictures as `serde` would have them, to compare bytes with.
#[derive(Serialize)]
struct PlainImage<'a> {
    stamp: Time,
    frame_id: &'a str,
    height: u32,
    width: u32,
    encoding: &'a str,
    is_bigendian: u8,
    step: u32,
    data: &'a [u8],
}

fn encoded<E: Encode>(value: &E) -> Vec<u8> {
    let mut bytes = vec![0xaa; value.encoded_len()];
    value.encode(&mut bytes).unwrap();
    bytes
}

fn survives<M>(value: &M)
where
    M: for<'a> Message<View<'a> = M> + Encode + PartialEq + std::fmt::Debug,
{
    let mut bytes = encoded(value);
    assert_eq!(&M::decode(&bytes).unwrap(), value);
    bytes.extend([0; 3]);
    assert_eq!(&M::decode(&bytes).unwrap(), value, "padding at the end is allowed");
}

#[test]
fn a_bool_is_one_byte_and_empty_is_too() {
    assert_eq!(encoded(&std_msgs::Bool { data: true }), [1]);
    assert_eq!(encoded(&std_msgs::Empty::default()), [0]);
}

#[test]
fn a_string_has_its_length_and_its_end() {
    let text = std_msgs::String { data: String::from("hi") };
    assert_eq!(encoded(&text), [3, 0, 0, 0, b'h', b'i', 0]);
}

#[test]
fn every_known_type_is_found_by_its_name_and_tells_its_parts() {
    for (name, text) in known() {
        assert_eq!(definition_of(name), Some(*text));
    }
    let odometry = definition_of("nav_msgs/msg/Odometry").unwrap();
    for part in ["MSG: geometry_msgs/TwistWithCovariance\n", "MSG: builtin_interfaces/Time\n"] {
        assert!(odometry.contains(part), "{part}");
    }
    assert_eq!(definition_of("my_msgs/msg/Nothing"), None);
}

#[test]
fn odometry_keeps_its_covariances() {
    let mut odometry = nav_msgs::Odometry::default();
    odometry.header.frame_id = String::from("map");
    odometry.pose.covariance[35] = 0.25;
    odometry.twist.twist.linear.x = 0.3;
    survives(&odometry);
    survives(&Imu { orientation_covariance: [1.5; 9], ..Imu::default() });
}

#[test]
fn a_charge_stands_where_ros_2_has_it() {
    let battery = BatteryState {
        percentage: 0.5,
        present: true,
        cell_voltage: vec![3.7, 3.8],
        serial_number: String::from("b7"),
        ..BatteryState::default()
    };

    // Stamp, the empty name of a frame with its padding, and six floats come before it.
    let bytes = encoded(&battery);
    assert_eq!(bytes[8..13], [1, 0, 0, 0, 0]);
    assert_eq!(bytes[40..44], 0.5_f32.to_le_bytes());
    assert_eq!(bytes[44..48], [0, 0, 0, 1]);
    survives(&battery);
}

#[test]
fn a_picture_is_filled_in_place() {
    let shape = ImageView::rgb8(Time::from_nanos(5), "camera", 2, 1, &[]);
    let mut bytes = vec![0; shape.encoded_len_with(6)];

    shape.begin(6, &mut bytes).unwrap().copy_from_slice(&[1, 2, 3, 4, 5, 6]);

    let image = Image::decode(&bytes).unwrap();
    assert_eq!((image.width, image.step, image.data), (2, 6, [1, 2, 3, 4, 5, 6].as_slice()));
}

#[test]
fn a_turn_to_the_left_comes_back() {
    for yaw in [-3.0, -0.5, 0.0, 0.1, 3.0] {
        let back = geometry_msgs::Quaternion::from_yaw(yaw).yaw();
        assert!((back - yaw).abs() < 1e-12, "{yaw} {back}");
    }
}

proptest! {
    #[test]
    fn a_picture_in_place_is_the_same_bytes_as_through_serde(
        (sec, nanosec, height, width, step) in any::<(i32, u32, u32, u32, u32)>(),
        frame_id in "[a-z_]{0,9}",
        encoding in "[a-z0-9]{0,7}",
        data in prop::collection::vec(any::<u8>(), 0..50),
    ) {
        let stamp = Time { sec, nanosec };
        let view = ImageView {
            stamp, frame_id: &frame_id, height, width, encoding: &encoding, is_bigendian: 1, step,
            data: &data,
        };
        let plain = PlainImage {
            stamp, frame_id: &frame_id, height, width, encoding: &encoding, is_bigendian: 1, step,
            data: &data,
        };

        let bytes = encoded(&view);

        prop_assert_eq!(&cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&plain).unwrap(), &bytes);
        prop_assert_eq!(Image::decode(&bytes).unwrap(), view);
    }

    #[test]
    fn a_compressed_picture_survives(
        frame_id in "[a-z_]{0,9}",
        format in "[a-z]{0,5}",
        data in prop::collection::vec(any::<u8>(), 0..50),
    ) {
        let stamp = Time { sec: 1, nanosec: 2 };
        let view = CompressedImageView { stamp, frame_id: &frame_id, format: &format, data: &data };
        let bytes = encoded(&view);
        let plain = (stamp, frame_id.as_str(), format.as_str(), data.as_slice());
        prop_assert_eq!(&cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&plain).unwrap(), &bytes);
        prop_assert_eq!(CompressedImage::decode(&bytes).unwrap(), view);
    }

    #[test]
    fn plain_messages_survive(text in ".{0,20}", number in any::<i32>(), yaw in -3.0..3.0_f64) {
        survives(&std_msgs::String { data: text.replace('\0', "") });
        survives(&std_msgs::Int32 { data: number });
        let pose = geometry_msgs::Pose {
            orientation: geometry_msgs::Quaternion::from_yaw(yaw),
            ..geometry_msgs::Pose::default()
        };
        survives(&geometry_msgs::PoseStamped { header: std_msgs::Header::default(), pose });
    }

    #[test]
    fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..800)) {
        let _ = Image::decode(&bytes);
        let _ = CompressedImage::decode(&bytes);
        let _ = Imu::decode(&bytes);
        let _ = BatteryState::decode(&bytes);
        let _ = nav_msgs::Odometry::decode(&bytes);
        let _ = std_msgs::String::decode(&bytes);
        let _ = std_msgs::Bool::decode(&bytes);
        let _ = geometry_msgs::Twist::decode(&bytes);
    }
}
