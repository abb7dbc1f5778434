//! The names of topics and types, which ROS 2 changes for DDS.

/// The topic of DDS for a topic of ROS 2: `/imu/data` is `rt/imu/data`.
pub fn of_topic(topic: &str) -> String {
    format!("rt/{}", topic.trim_start_matches('/'))
}

/// The topics of DDS for the requests of a service of ROS 2 and for its answers.
pub fn of_service(service: &str) -> [String; 2] {
    let name = service.trim_start_matches('/');
    [format!("rq/{name}Request"), format!("rr/{name}Reply")]
}

/// The type of DDS for a type of ROS 2: `sensor_msgs/msg/Imu` is `sensor_msgs::msg::dds_::Imu_`.
pub fn of_type(kind: &str) -> String {
    match kind.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => kind.to_owned(),
    }
}

/// The topic of ROS 2 for a topic of DDS; `None` for one that is no topic of ROS 2.
pub fn ros_topic(topic: &str) -> Option<String> {
    topic.strip_prefix("rt").filter(|rest| rest.starts_with('/')).map(str::to_owned)
}

/// The type of ROS 2 for a type of DDS; `None` for one that is no message of ROS 2.
pub fn ros_type(kind: &str) -> Option<String> {
    let (package, name) = kind.split_once("::dds_::")?;
    Some(format!("{}/{}", package.replace("::", "/"), name.strip_suffix('_')?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_changed_as_ros_2_does_and_back() {
        for (ros, dds) in [
            ("sensor_msgs/msg/Imu", "sensor_msgs::msg::dds_::Imu_"),
            ("tf2_msgs/msg/TFMessage", "tf2_msgs::msg::dds_::TFMessage_"),
        ] {
            assert_eq!(of_type(ros), dds);
            assert_eq!(ros_type(dds).as_deref(), Some(ros));
        }
        assert_eq!(
            of_type("std_srvs/srv/Trigger_Request"),
            "std_srvs::srv::dds_::Trigger_Request_"
        );
        assert_eq!(
            of_service("/navfuse/reset"),
            ["rq/navfuse/resetRequest", "rr/navfuse/resetReply"]
        );
        assert_eq!(of_topic("/imu/data"), "rt/imu/data");
        assert_eq!(ros_topic("rt/imu/data").as_deref(), Some("/imu/data"));
        // a service and a topic of another program
        assert_eq!((ros_topic("rq/resetRequest"), ros_type("ShapeType")), (None, None));
    }
}
