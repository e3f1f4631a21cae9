//! Constants, defaults, bounds, names and definitions of the types in `tests/kinds`.

use crate::kinds::action::{Act, ActFeedbackMessage};
use crate::kinds::msg::{Empty, Everything, Inner, Numbers};
use crate::kinds::srv::{Ask, AskRequest, AskResponse, NothingRequest};
use crate::{Action, Interface, Service, cdr};
use std::collections::HashSet;

#[test]
fn constants_have_their_types_and_values() {
    let flags: [bool; 2] = [Everything::YES, Everything::NO];
    assert_eq!(flags, [true, false]);
    let octets: [u8; 3] = [Everything::B, Everything::LETTER, Everything::HIGH];
    assert_eq!(octets, [255, 65, 255]);
    assert_eq!((Everything::LOW, Everything::I16), (i8::MIN, i16::MIN));
    assert_eq!((Everything::I32, Everything::I64), (i32::MIN, i64::MIN));
    assert_eq!((Everything::U16, Everything::U32, Everything::U64), (u16::MAX, u32::MAX, u64::MAX));
    assert_eq!((Everything::F32, Everything::F64), (0.1_f32, -1e-300));
    assert_eq!(Everything::PLAIN, "two words");
    assert_eq!(Everything::QUOTED, "a # b \" c");
    assert_eq!(Everything::SINGLE, "it is \"so\"");
    assert_eq!((AskRequest::WHY, AskResponse::BECAUSE), (1, 2));
}

#[test]
fn defaults_are_those_of_the_file() {
    let all = Everything::default();
    assert!(all.flag && all.octet == 7 && all.small == -5 && all.big == 200 && all.i64 == -9);
    assert_eq!((all.f32, all.f64), (1.5, -2500.0));
    assert_eq!((all.text.as_str(), all.short_text.as_str()), ("hello", "world"));
    assert_eq!(all.three_octets, [1, 2, 3]);
    assert_eq!(all.two_texts, ["a, b", "c]d"]);
    assert_eq!((all.raw, all.doubles), (vec![9, 8], vec![0.5, -1.0]));
    assert_eq!((all.texts, all.few_numbers), (vec!["x".to_string()], vec![1, 2]));
    assert_eq!((all.u16, all.octets.len(), all.covariance), (0, 0, [0.0; 36]));
    let inner = Inner { a: 0, b: 2.5, c: "in\"ner".into(), d: 0 };
    assert_eq!((&all.inner, &all.many_inner[33]), (&inner, &inner));
    assert_eq!(AskResponse::default().answer, "none");
    assert_eq!(crate::geometry_msgs::msg::Quaternion::default().w, 1.0);
}

/// Reads `json` with another value of one field.
fn read_with(
    json: &serde_json::Value,
    field: &str,
    value: serde_json::Value,
) -> serde_json::Result<Everything> {
    let mut json = json.clone();
    json[field] = value;
    serde_json::from_value(json)
}

#[test]
fn bounds_hold_when_writing_and_when_reading() {
    let ways: [fn(&mut Everything); 5] = [
        |all| all.short_text = "nine char".into(),
        |all| all.few_octets = vec![0; 5],
        |all| all.few_numbers = vec![0; 4],
        |all| all.few_texts = vec!["a".into(); 3],
        |all| all.few_inner = vec![Inner::default(); 3],
    ];
    for break_bound in ways {
        let mut all = Everything::default();
        break_bound(&mut all);
        let error = cdr::to_bytes(&all).unwrap_err().to_string();
        assert!(error.contains("its type allows"), "{error}");
    }
    let json = serde_json::to_value(Everything::default()).unwrap();
    assert!(read_with(&json, "few_numbers", vec![1, 2, 3].into()).is_ok());
    assert!(read_with(&json, "few_numbers", vec![1, 2, 3, 4].into()).is_err());
    assert!(read_with(&json, "short_text", "12345678".into()).is_ok());
    assert!(read_with(&json, "short_text", "123456789".into()).is_err());
    assert!(read_with(&json, "covariance", vec![0.0; 35].into()).is_err());
}

#[test]
fn names_and_definitions_are_those_of_ros() {
    assert_eq!(Everything::TYPE_NAME, "kinds/msg/Everything");
    assert_eq!((AskRequest::TYPE_NAME, AskRequest::KIND), ("kinds/srv/Ask_Request", "srv"));
    assert_eq!((Ask::TYPE_NAME, Ask::NAME), ("kinds/srv/Ask", "Ask"));
    assert_eq!(<Act as Action>::TYPE_NAME, "kinds/action/Act");
    assert_eq!(<Act as Action>::SendGoal::TYPE_NAME, "kinds/action/Act_SendGoal");
    assert_eq!(<Act as Action>::GetResult::NAME, "Act_GetResult");
    let line = "=".repeat(80);
    assert_eq!(Numbers::DEFINITION, "int64[2] first\nint32 second\n");
    assert_eq!(
        <Act as Action>::Goal::DEFINITION,
        format!(
            "# Acts.\nkinds/Numbers numbers\n{line}\nMSG: kinds/Numbers\n\
             int64[2] first\nint32 second\n"
        )
    );
    assert_eq!(
        ActFeedbackMessage::DEFINITION,
        format!(
            "unique_identifier_msgs/UUID goal_id\nkinds/Act_Feedback feedback\n{line}\n\
             MSG: unique_identifier_msgs/UUID\nuint8[16] uuid\n{line}\n\
             MSG: kinds/Act_Feedback\nfloat32 fraction\n"
        )
    );
    let poses = Everything::DEFINITION.matches("MSG: geometry_msgs/Pose\n").count();
    assert_eq!(poses, 1);
}

#[test]
fn an_empty_message_is_one_octet() {
    assert_eq!(cdr::to_bytes(&Empty::default()).unwrap(), [0, 1, 0, 0, 0]);
    assert_eq!(cdr::to_bytes(&NothingRequest::default()).unwrap(), [0, 1, 0, 0, 0]);
}

#[test]
fn small_plain_types_can_be_copied_and_hashed() {
    fn copies<T: Copy>() {}
    copies::<crate::geometry_msgs::msg::Pose>();
    copies::<Numbers>();
    let ids: HashSet<crate::unique_identifier_msgs::msg::UUID> = HashSet::new();
    assert!(ids.is_empty());
}

#[test]
fn bytes_of_another_encoding_are_refused_with_a_reason() {
    let big: Numbers = cdr::from_bytes(&[&[0, 0, 0, 0], &[0; 15][..], &[9, 0, 0, 0, 7]].concat())
        .expect("big-endian CDR is read, too");
    assert_eq!(big, Numbers { first: [0, 9], second: 7 });
    let error = cdr::from_bytes::<Numbers>(&[0, 7, 0, 0, 1]).unwrap_err().to_string();
    assert!(error.contains("[00, 07, 00, 00]"), "{error}");
    let error = cdr::from_bytes::<Numbers>(&[0, 1]).unwrap_err().to_string();
    assert!(error.contains("no CDR message"), "{error}");
}
